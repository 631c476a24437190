"""The sound card: PortAudio through sounddevice; opened, lost and opened again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.show.sound import SoundConfig

RETRY_S = 1.0


class CardError(OSError):
    """The card, or the library, is not here: what is missing, and what to do."""


class Card:
    """Plays what `render` gives, in PortAudio's own thread. `look` opens it again after it was away.

    trouble: why it is silent, else "". dropouts: blocks that came too late.
    """

    def __init__(self, config: SoundConfig, render: Callable[[int], NDArray[np.float32]]) -> None:
        """Raises CardError where the library is missing: trying again would not help."""
        try:
            import sounddevice
        except (ImportError, OSError) as error:
            raise CardError(
                f"The sound library is not here ({error}). Nothing sounds. Install the Debian package "
                "libportaudio2, and `pip install bunraku[sound]`."
            ) from error
        self._library, self._config, self._render = sounddevice, config, render
        self._stream: Any = None
        self._tries_at = 0.0
        self.trouble, self.dropouts = "", 0

    def look(self, now: float) -> None:
        """Open the card where it is not; call it often. Monotonic seconds."""
        if self._stream is not None and not self._stream.active:
            self._drop("The sound card was unplugged.")
        if self._stream is None and now >= self._tries_at:
            self._tries_at = now + RETRY_S
            self._open()

    def close(self) -> None:
        """Give the card back."""
        self._drop("")

    def _open(self) -> None:
        library, config = self._library, self._config
        try:
            library._terminate()  # PortAudio lists the cards once, when it starts
            library._initialize()
            stream = library.OutputStream(
                samplerate=config.rate,
                blocksize=config.block // 32 * 32,
                device=config.device,
                channels=config.channels,
                dtype="float32",
                latency="low",
                callback=self._fill,
            )
            stream.start()
        except (library.PortAudioError, ValueError, OSError) as error:
            self.trouble = (
                f"No sound card plays {config.channels} channels at {config.rate} Hz ({error}). The strings "
                "are silent. Plug one in, or give another `sound:` in the box file."
            )
            return
        self._stream, self.trouble = stream, ""

    def _fill(self, out: NDArray[np.float32], frames: int, time: Any, status: Any) -> None:
        self.dropouts += bool(status.output_underflow)
        out[:] = self._render(frames)

    def _drop(self, trouble: str) -> None:
        self.trouble = trouble
        if self._stream is not None:
            self._stream.abort(ignore_errors=True)
            self._stream.close(ignore_errors=True)
        self._stream = None
