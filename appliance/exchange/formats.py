"""Recordings by the ending of their file: .bvh, .glb, .npz and .csv, in and out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_reading import WHOLE, Choice, read_glb
from appliance.exchange.glb_writing import write_glb
from appliance.exchange.tables import read_csv, read_npz, write_csv, write_npz
from appliance.pose.bvh import write_bvh
from appliance.pose.plain_names import changed_names, plain_names
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions, brought_in, read_upright
from appliance.pose.recording import Recording
from appliance.pose.stage_frame import Guess

_WRITERS: dict[str, Callable[[Path, Recording], None]] = {
    ".glb": write_glb,
    ".npz": write_npz,
    ".csv": write_csv,
}
_METRE = 1.0  # in all formats but BVH
ENDINGS = (".bvh", *_WRITERS)


def read_as_told(
    path: Path, reading: ReadingOptions = AS_THE_FILES_SAY, choice: Choice = WHOLE
) -> tuple[Recording, list[Guess]]:
    """All of a recording in the stage's frame, and what was lost or changed.

    choice: of a file with several skins or animations. Raises ExchangeError or BvhError, which name the file.
    """
    ending = _ending(path)
    if choice != WHOLE and ending != ".glb":
        raise ExchangeError(path, "Only a .glb has skins and animations: leave --skin and --animation out.")
    true_fps = reading.fps_of(path.stem)
    try:
        if ending == ".bvh":
            return read_upright(path, reading)
        if ending == ".glb":
            recording = read_glb(path, true_fps, choice)
        else:
            recording = (read_npz if ending == ".npz" else read_csv)(path, true_fps)
    except OSError as error:
        raise ExchangeError(path, f"The file cannot be read ({error.strerror or error}).") from error
    return brought_in(path, recording, reading.reading_of(path.stem), _METRE)


def write_recording(path: Path, recording: Recording) -> str:
    """Write a recording whole, or leave what was there; joints' names that it changed, in words.

    Raises ExchangeError.
    """
    ending = _ending(path)
    if not len(recording):
        raise ExchangeError(path, "The recording has no frames: nothing was written.")
    names = recording.skeleton.names
    recording = replace(recording, skeleton=replace(recording.skeleton, names=plain_names(names)))
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
    return changed_names(names)


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
