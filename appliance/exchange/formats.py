"""Recordings as files, by the ending of the file: .bvh, .glb, .npz and .csv."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_writing import write_glb
from appliance.exchange.tables import write_csv, write_npz
from appliance.pose.bvh import write_bvh
from appliance.pose.plain_names import changed_names, plain_names
from appliance.pose.recording import Recording
from appliance.pose.whole_file import written_whole

_WRITERS: dict[str, Callable[[Path, Recording], None]] = {
    ".glb": write_glb,
    ".npz": write_npz,
    ".csv": write_csv,
}
ENDINGS = (".bvh", *_WRITERS)


def write_recording(path: Path, recording: Recording) -> str:
    """Write a recording whole, or leave what was there; joints' names that it changed, in words.

    Raises ExchangeError.
    """
    ending = known_ending(path)
    if not len(recording):
        raise ExchangeError(path, "The recording has no frames: nothing was written.")
    names = recording.skeleton.names
    recording = replace(recording, skeleton=replace(recording.skeleton, names=plain_names(names)))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as beside:
            if ending == ".bvh":
                write_bvh(beside, recording)
            else:
                _WRITERS[ending](beside, recording)
    except OSError as error:
        raise ExchangeError(
            path, f"The file cannot be written ({error.strerror or error}). Name another place."
        ) from error
    return changed_names(names)


def known_ending(path: Path) -> str:
    """The ending of this file. Raises ExchangeError where no format has it."""
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise ExchangeError(
            path, f"The ending '{path.suffix}' is no format of recordings. Known: {', '.join(ENDINGS)}."
        )
    return ending
