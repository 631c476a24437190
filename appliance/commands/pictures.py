"""Filmstrips of journals and recordings: what was danced, with the held joints highlighted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from appliance.pose.bvh import read_bvh
from appliance.pose.filmstrip import MissingPicturesError, draw_filmstrip
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.stage.clock import TICK_S
from appliance.stage.journal import read_journal
from appliance.stage.stage_error import StageError


def picture_of_file(
    source: Path, out: Path | None, start_s: float, seconds: float, metres_per_unit: float
) -> Path:
    """A filmstrip of a BVH recording or a journal. Raises BvhError, JournalError or StageError."""
    out = out or source.with_suffix(".png")
    if source.suffix.lower() != ".bvh":
        return picture_of_journal(source, out, start_s, seconds)
    recording = read_bvh(source, metres_per_unit=metres_per_unit)
    part = _part(source, len(recording.poses), recording.fps, start_s, seconds)
    return _drawn(
        out, recording.skeleton, recording.poses[part], recording.roots[part], recording.fps, (), source.stem
    )


def picture_of_journal(source: Path, out: Path, start_s: float, seconds: float) -> Path:
    """A filmstrip of a journal, from `start_s` on; a negative start counts from its end."""
    journal = read_journal(source)
    skeleton, ticks = journal.skeleton, journal.ticks
    if start_s < 0.0:
        start_s = max(0.0, len(ticks) * TICK_S + start_s)
    ticks = ticks[_part(source, len(ticks), 1.0 / TICK_S, start_s, seconds)]
    held = [skeleton.index(hand["joint"]) for hand in journal.header["hands"]]
    return _drawn(out, skeleton, ticks["pose"], ticks["root"], 1.0 / TICK_S, held, source.stem)


def _part(source: Path, count: int, fps: float, start_s: float, seconds: float) -> slice:
    first, last = round(start_s * fps), round((start_s + seconds) * fps)
    if first >= count:
        raise StageError(f"{source}: nothing was danced after second {start_s:g}. Choose an earlier start.")
    return slice(first, last)


def _drawn(
    out: Path, skeleton: Skeleton, poses: Array, roots: Array, fps: float, held: Sequence[int], title: str
) -> Path:
    try:
        return draw_filmstrip(out, skeleton, poses, roots, fps, held=held, title=title)
    except MissingPicturesError as error:
        raise StageError(str(error)) from error
    except OSError as error:
        raise StageError(f"{out}: the picture cannot be written ({error.strerror}).") from error
