"""The picture by NDI, through NDI's own library where it is installed: its licence keeps it out of here."""

from __future__ import annotations

import ctypes
import os
from ctypes.util import find_library
from fractions import Fraction
from pathlib import Path

import numpy as np

from appliance.projector.stream.keying import keyed
from appliance.projector.stream.pipe import Picture

_NAMES = ("libndi.so.6", "libndi.so.5", "libndi.so")
_FOLDERS = ("NDI_RUNTIME_DIR_V6", "NDI_RUNTIME_DIR_V5")  # where NDI's installers say that the library is
_RGBA, _RGBX = (int.from_bytes(code, "little") for code in (b"RGBA", b"RGBX"))
_PROGRESSIVE, _NOW = 1, 2**63 - 1  # NDIlib_frame_format_type_progressive, NDIlib_send_timecode_synthesize


class _Sender(ctypes.Structure):
    """NDIlib_send_create_t."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("groups", ctypes.c_char_p),
        ("clocks_video", ctypes.c_bool),
        ("clocks_audio", ctypes.c_bool),
    )


class _Frame(ctypes.Structure):
    """NDIlib_video_frame_v2_t."""

    _fields_ = (
        ("width", ctypes.c_int),
        ("height", ctypes.c_int),
        ("four_cc", ctypes.c_int),
        ("rate_n", ctypes.c_int),
        ("rate_d", ctypes.c_int),
        ("aspect", ctypes.c_float),
        ("format", ctypes.c_int),
        ("timecode", ctypes.c_int64),
        ("pixels", ctypes.c_void_p),
        ("stride", ctypes.c_int),
        ("metadata", ctypes.c_char_p),
        ("timestamp", ctypes.c_int64),
    )


class NdiSource:
    """A source of that name in the network. Raises OSError where there is no library, or it refuses."""

    def __init__(self, name: str, rate: float, has_alpha: bool) -> None:
        """rate: pictures a second at most; has_alpha: as much as a pixel shines."""
        self._rate, self._has_alpha = Fraction(rate).limit_denominator(1001), has_alpha
        self._library = _library()
        self._source = None
        if self._library.NDIlib_initialize():
            self._source = self._library.NDIlib_send_create(
                ctypes.byref(_Sender(name.encode(), None, False, False))
            )
        if not self._source:
            raise OSError("NDI's library refuses: does it support this processor?")

    @property
    def receivers(self) -> int:
        """How many programs receive it now."""
        return int(self._library.NDIlib_send_get_no_connections(self._source, 0))

    def send(self, picture: Picture) -> None:
        """Send a picture; it is compressed before this returns."""
        width, height, pixels = picture
        shown = np.frombuffer(keyed(pixels) if self._has_alpha else pixels, np.uint8)
        frame = _Frame(
            width=width,
            height=height,
            four_cc=_RGBA if self._has_alpha else _RGBX,
            rate_n=self._rate.numerator,
            rate_d=self._rate.denominator,
            format=_PROGRESSIVE,
            timecode=_NOW,
            pixels=shown.ctypes.data,
            stride=4 * width,
        )
        self._library.NDIlib_send_send_video_v2(self._source, ctypes.byref(frame))


def _library() -> ctypes.CDLL:
    folders = [Path(os.environ[name]) for name in _FOLDERS if name in os.environ]
    files = [str(folder / name) for folder in folders for name in _NAMES if (folder / name).exists()]
    found = [*files, find_library("ndi"), *_NAMES]
    for file in filter(None, found):
        try:
            library = ctypes.CDLL(file)
        except OSError:
            continue
        library.NDIlib_initialize.restype = ctypes.c_bool
        library.NDIlib_send_create.restype = ctypes.c_void_p
        library.NDIlib_send_get_no_connections.argtypes = (ctypes.c_void_p, ctypes.c_uint32)
        library.NDIlib_send_send_video_v2.argtypes = (ctypes.c_void_p, ctypes.c_void_p)
        return library
    raise OSError("there is no libndi on this machine")
