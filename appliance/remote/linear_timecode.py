"""Linear timecode: an audio track that libltc decodes (SMPTE ST 12-1; package libltc11)."""

from __future__ import annotations

import contextlib
import ctypes
from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.box.alsa import has_sound, start_anew
from appliance.remote.midi_timecode import CodeHeard
from appliance.remote.timecode import RATES, Rate, Timecode

_LIBRARY = "libltc.so.11"
_QUEUE = 64  # labels
_RETRY_S = 2.0
_SILENT_S = 1.0
SAMPLE_RATE = 48_000
_BLOCK = 256
_MAY_DIFFER = 0.02  # share of a frame's samples: a track is played this much too fast or too slow


class _Frame(ctypes.Structure):
    """LTCFrameExt of ltc.h."""

    _fields_ = (
        ("ltc", ctypes.c_uint * 3),
        ("off_start", ctypes.c_longlong),
        ("off_end", ctypes.c_longlong),
        ("reverse", ctypes.c_int),
        ("biphase_tics", ctypes.c_float * 80),
        ("sample_min", ctypes.c_ubyte),
        ("sample_max", ctypes.c_ubyte),
        ("volume", ctypes.c_double),
    )


class _Label(ctypes.Structure):
    """SMPTETimecode of ltc.h."""

    _fields_ = (
        ("timezone", ctypes.c_char * 6),
        *((name, ctypes.c_ubyte) for name in ("years", "months", "days", "hours", "mins", "secs", "frame")),
    )


class LtcDecoder:
    """Labels in an audio track. Raises OSError where libltc is not installed."""

    def __init__(self, sample_rate: int = SAMPLE_RATE) -> None:
        self._library = library = ctypes.CDLL(_LIBRARY)
        library.ltc_decoder_create.restype = ctypes.c_void_p
        library.ltc_decoder_write_float.argtypes = (
            *(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_longlong),
        )
        library.ltc_decoder_read.argtypes = (ctypes.c_void_p, ctypes.POINTER(_Frame))
        library.ltc_decoder_free.argtypes = (ctypes.c_void_p,)
        library.ltc_frame_to_time.argtypes = (ctypes.POINTER(_Label), ctypes.c_void_p, ctypes.c_int)
        self._sample_rate = sample_rate
        self._decoder = ctypes.c_void_p(library.ltc_decoder_create(sample_rate // 25, _QUEUE))
        self._at = 0
        self._highest: deque[int] = deque(maxlen=2)  # highest frame numbers of the last seconds
        self._rate: Rate | None = None

    def labels(self, samples: NDArray[np.float32]) -> Iterator[tuple[CodeHeard, float]]:
        """Each label that ends in these samples (n,), and how many seconds before their end it did."""
        track = np.ascontiguousarray(samples, np.float32)
        self._library.ltc_decoder_write_float(self._decoder, track.ctypes.data, len(track), self._at)
        self._at += len(track)
        frame, label = _Frame(), _Label()
        while self._library.ltc_decoder_read(self._decoder, ctypes.byref(frame)):
            self._library.ltc_frame_to_time(ctypes.byref(label), ctypes.addressof(frame), 0)
            rate = self._rate_of(frame)
            if rate is None:
                continue
            with contextlib.suppress(ValueError):
                code = Timecode(label.hours, label.mins, label.secs, label.frame, rate)
                ahead = 0.0 if frame.reverse else 1.0  # it is over
                yield CodeHeard(code, ahead), (self._at - frame.off_end) / self._sample_rate

    def close(self) -> None:
        if self._decoder:
            self._library.ltc_decoder_free(self._decoder)
        self._decoder = ctypes.c_void_p()

    def _rate_of(self, frame: _Frame) -> Rate | None:
        """By its drop-frame bit, else the rate whose frames are as long; None: none is."""
        drops = bool(frame.ltc[0] >> 10 & 1)
        samples = sum(frame.biphase_tics)
        for rate in RATES:
            usual = self._sample_rate / rate.per_second
            if rate.drops == drops and abs(samples - usual) < _MAY_DIFFER * usual:
                return rate
        return None


class LtcInput:
    """A sound card's input, opened again after it was away. Never raises. trouble: why it is not heard."""

    def __init__(self, device: str | int | None) -> None:
        self._device = device
        self._stream: Any = None
        self._decoder: LtcDecoder | None = None
        self._tries_at = self._heard_at = 0.0
        self.trouble = ""

    def labels(self, now: float) -> Iterator[tuple[CodeHeard, float]]:
        """Each label that has come, and the monotonic second at which it ended."""
        if self._stream is None:
            self._open(now)
        if self._stream is None or self._decoder is None:
            return
        try:
            waiting = int(self._stream.read_available)
            samples = self._stream.read(waiting)[0] if waiting else None
        except Exception as error:  # PortAudio's own class is not known before it is loaded
            self._drop(f"The sound input for timecode is away ({error}).", now)
            return
        if samples is not None:
            self._heard_at = now
            latency_s = float(self._stream.latency)
            for heard, before_s in self._decoder.labels(samples[:, 0]):
                yield heard, now - before_s - latency_s
        elif now - self._heard_at > _SILENT_S:
            self._drop("The sound input for timecode gives nothing.", now)

    def close(self) -> None:
        self._drop("", 0.0)

    def _open(self, now: float) -> None:
        if now < self._tries_at:
            return
        self._tries_at = now + _RETRY_S
        try:
            if not has_sound():
                raise OSError("ALSA is not configured: Debian package libasound2-data")
            import sounddevice

            self._decoder = LtcDecoder()
            start_anew(sounddevice)
            self._stream = sounddevice.InputStream(
                samplerate=SAMPLE_RATE, blocksize=_BLOCK, device=self._device, channels=1, latency="low"
            )
            self._stream.start()
        except Exception as error:
            self._drop(
                f"The sound input for timecode cannot be opened ({error}). Cues wait for a GO by hand. Plug "
                "the card in, give another `device` under timecode in the box file, or install libltc11 and "
                "libportaudio2.",
                now,
            )
            return
        self.trouble, self._heard_at = "", now

    def _drop(self, trouble: str, now: float) -> None:
        self.trouble, self._tries_at = trouble, now + _RETRY_S
        if self._stream is not None:
            self._stream.abort(ignore_errors=True)
            self._stream.close(ignore_errors=True)
        if self._decoder is not None:
            self._decoder.close()
        self._stream = self._decoder = None
