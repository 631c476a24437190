"""Recordings by the ending of their file, brought into the stage's frame."""

from __future__ import annotations

from pathlib import Path

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.formats import known_ending
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions, brought_in, read_upright
from appliance.pose.recording import Recording
from appliance.pose.stage_frame import Guess
from appliance.studio.exchange.glb_reading import WHOLE, Choice, read_glb
from appliance.studio.exchange.table_reading import read_csv, read_npz

_METRE = 1.0  # in all formats but BVH


def read_as_given(
    path: Path, reading: ReadingOptions = AS_THE_FILES_SAY, choice: Choice = WHOLE
) -> tuple[Recording, list[Guess]]:
    """All of a recording in the stage's frame, and what was lost or changed.

    choice: of a file with several skins or animations. Raises ExchangeError or BvhError, which name the file.
    """
    ending = known_ending(path)
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
    return brought_in(path, recording, reading.conventions_of(path.stem), _METRE)
