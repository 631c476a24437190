"""The sound card: PortAudio through sounddevice; opened, lost and opened again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.box.alsa import has_sound, start_anew
from appliance.box.realtime import thread_priority
from appliance.show.sound import SoundConfig

RETRY_S = 1.0
LIBRARY_RETRY_S = 10.0  # to look for it costs a tenth of a second
STALLED_S = 1.0  # without a request for a block: the card is gone, whatever its driver says
OFTEN, COUNTED_S, LONGEST = 6, 10.0, 512  # dropouts; samples


class Card:
    """Plays what `render` gives, in PortAudio's own thread. `look` opens it again after it was away.

    trouble: why it is silent, else ""; is_missing: because this system has no sound at all. dropouts: blocks
    that came too late; after OFTEN of them within COUNTED_S it asks for blocks twice as long, up to LONGEST,
    until it is opened anew. refused: why the thread has no real-time priority, else "".
    """

    def __init__(
        self, config: SoundConfig, render: Callable[[int], NDArray[np.float32]], priority: int | None = None
    ) -> None:
        """priority: real-time, of PortAudio's thread; None: as the process has it."""
        self._config, self._render, self._priority = config, render, priority
        self._wanted_priority = priority
        self._library: Any = None
        self._stream: Any = None
        self._tries_at = 0.0
        self._blocks, self._seen = 0, (0, 0.0)  # seen: the count of blocks, and when
        self._block, self._counted = config.block, (0, 0.0)  # counted: the dropouts, and when
        self.trouble, self.dropouts, self.is_missing, self.refused = "", 0, False, ""

    @property
    def name(self) -> str:
        """As the box file has it; "" for the system's own choice."""
        return "" if self._config.device is None else str(self._config.device)

    def look(self, now: float) -> None:
        """Open the card where it is not; call it often. Monotonic seconds."""
        if self._stream is not None:
            if self._blocks != self._seen[0]:
                self._seen = self._blocks, now
            if not self._stream.active or now - self._seen[1] > STALLED_S:
                self._drop("The sound card was unplugged. The strings are silent until it is back.")
            elif self._drops_out_often(now) and self._block < LONGEST:
                self._block = min(2 * self._block, LONGEST)
                self._drop("")
                self._open(now)
        if self._stream is None and now >= self._tries_at:
            self._block = self._config.block
            self._tries_at = now + RETRY_S
            self._open(now)

    def close(self) -> None:
        self._drop("")

    def _drops_out_often(self, now: float) -> bool:
        before, since = self._counted
        if now - since <= COUNTED_S and self.dropouts - before < OFTEN:
            return False
        self._counted = self.dropouts, now
        return now - since <= COUNTED_S

    def _open(self, now: float) -> None:
        config, self.is_missing = self._config, True
        if not has_sound():
            self.trouble = (
                "This system has no sound: ALSA, through which Linux reaches sound cards, is not configured. "
                "The strings are silent, and are looked for each second. Install the Debian package "
                "libasound2-data, or remove `sound:` from the box file."
            )
            return
        try:
            library = self._library or _loaded()
        except (ImportError, OSError) as error:
            self._tries_at = now + LIBRARY_RETRY_S
            self.trouble = (
                f"The sound library is not here ({error}). The strings are silent, and it is looked for "
                f"again each {LIBRARY_RETRY_S:.0f} s. Install the Debian package libportaudio2, or remove "
                "`sound:` from the box file."
            )
            return
        self.is_missing = False
        try:
            start_anew(library)
            self._library, self._priority = library, self._wanted_priority
            stream = library.OutputStream(
                samplerate=config.rate,
                blocksize=self._block,
                device=config.device,
                channels=config.channels,
                dtype="float32",
                latency=self._block / config.rate,  # "low" means 8 ms to PortAudio, however small a block is
                callback=self._fill,
            )
            stream.start()
        except Exception as error:  # PortAudio's own class is not known before it is loaded
            self.trouble = (
                f"No sound card plays {config.channels} channels at {config.rate} Hz ({error}). The strings "
                "are silent. Plug one in, or give another `sound:` in the box file."
            )
            return
        self._stream, self.trouble, self._seen = stream, "", (self._blocks, now)

    def _fill(self, out: NDArray[np.float32], frames: int, time: Any, status: Any) -> None:
        if self._priority is not None:  # in the thread that has to have it
            self.refused, self._priority = thread_priority(self._priority), None
        self._blocks += 1
        self.dropouts += bool(status.output_underflow)
        out[:] = self._render(frames)

    def _drop(self, trouble: str) -> None:
        self.trouble = trouble
        if self._stream is not None:
            self._stream.abort(ignore_errors=True)
            self._stream.close(ignore_errors=True)
        self._stream = None


def _loaded() -> Any:
    import sounddevice

    return sounddevice
