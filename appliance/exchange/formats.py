"""Recordings by the ending of their file: .bvh, .glb, .npz and .csv, in and out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_reading import read_glb
from appliance.exchange.glb_writing import write_glb
from appliance.exchange.tables import read_csv, read_npz, write_csv, write_npz
from appliance.pose.bvh import write_bvh
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions, read_upright
from appliance.pose.recording import Recording
from appliance.pose.stage_frame import Guess

_WRITERS: dict[str, Callable[[Path, Recording], None]] = {
    ".glb": write_glb,
    ".npz": write_npz,
    ".csv": write_csv,
}
_READERS: dict[str, Callable[[Path], Recording]] = {".glb": read_glb, ".npz": read_npz, ".csv": read_csv}
ENDINGS = (".bvh", *_WRITERS)


def read_as_told(path: Path, reading: ReadingOptions = AS_THE_FILES_SAY) -> tuple[Recording, list[Guess]]:
    """All of a recording, and what was changed. reading: of a BVH file; the others are in metres, Y up.

    Raises ExchangeError or BvhError, which name the file.
    """
    ending = _ending(path)
    try:
        if ending == ".bvh":
            return read_upright(path, reading)
        return _READERS[ending](path), []
    except OSError as error:
        raise ExchangeError(path, f"The file cannot be read ({error.strerror or error}).") from error


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording whole, or leave what was there. Raises ExchangeError."""
    ending = _ending(path)
    if not len(recording):
        raise ExchangeError(path, "The recording has no frames: nothing was written.")
    beside = path.with_name(f".{path.stem}.part{ending}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            if ending == ".bvh":
                write_bvh(beside, recording)
            else:
                _WRITERS[ending](beside, recording)
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        raise ExchangeError(
            path, f"The file cannot be written ({error.strerror or error}). Name another place."
        ) from error


def require_known_ending(path: Path) -> None:
    """Raises ExchangeError where no format has the ending of this file."""
    _ending(path)


def _ending(path: Path) -> str:
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise ExchangeError(
            path, f"The ending '{path.suffix}' is no format of recordings. Known: {', '.join(ENDINGS)}."
        )
    return ending
