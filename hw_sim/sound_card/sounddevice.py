"""Speaks the part of `sounddevice` (PortAudio for Python) that a box uses, for a card that nobody hears.

Like the buffer of an ALSA card: at each period's end by the card's own clock it asks for one more block,
which it plays behind those that it still holds. A block that comes too late is replaced by silence.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

_LOW_S = 384 / 48000  # PortAudio's "low" on ALSA: a buffer of 512 samples less a period of 128
_PRIORITY = 60  # hardware waits for no processor


def _initialize() -> None:
    """PortAudio's start."""


def _terminate() -> None:
    """PortAudio's end."""


class OutputStream:
    """As sounddevice's; `latency`: seconds that the card holds besides the block that it plays."""

    def __init__(
        self,
        samplerate: float,
        blocksize: int,
        device: Any,
        channels: int,
        dtype: str,
        latency: float | str,
        callback: Callable[[Any, int, Any, Any], None],
    ) -> None:
        self._rate, self._frames, self._fill = samplerate, blocksize, callback
        wanted_s = _LOW_S if isinstance(latency, str) else latency
        self._held = max(1, int(wanted_s * samplerate / blocksize + 1e-6))  # as PortAudio rounds it
        self.latency = self._held * blocksize / samplerate
        self._out = np.zeros((blocksize, channels), dtype)
        self._thread = threading.Thread(target=self._play, daemon=True)
        self._stopped = threading.Event()

    @property
    def active(self) -> bool:
        return self._thread.is_alive()

    def start(self) -> None:
        """Begin to ask for blocks."""
        self._thread.start()

    def abort(self, ignore_errors: bool = True) -> None:
        """Stop at once."""
        self._stopped.set()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def close(self, ignore_errors: bool = True) -> None:
        """Nothing is left to close."""

    def _play(self) -> None:
        period_s = self._frames / self._rate
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
        with Path(os.environ["BUNRAKU_EMULATED_CARD_LOG"]).open("ab", buffering=1 << 16) as log:
            begun, number, underran = time.monotonic(), 0, False
            while not self._stopped.is_set():
                asked_at = begun + number * period_s
                time.sleep(max(0.0, asked_at - time.monotonic()))
                plays_at = asked_at + self._held * period_s
                self._fill(self._out, self._frames, None, SimpleNamespace(output_underflow=underran))
                underran = time.monotonic() > plays_at
                heard = np.zeros(self._frames) if underran else self._out.sum(axis=1, dtype=np.float64)
                log.write(np.array([plays_at, self._frames, self._rate, underran, *heard]).tobytes())
                number += 1
