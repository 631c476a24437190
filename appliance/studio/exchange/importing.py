"""`bunraku import`: tracked points in, a dance of a fitted skeleton out, and its distance from the points."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appliance.exchange.exchange_error import ExchangeError
from appliance.pose.kept_rows import place_text
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.roles import places_of
from appliance.pose.skeleton import Skeleton
from appliance.studio.exchange.fitting import Gap, fit_skeleton, gaps_of, like, pose_frames
from appliance.studio.exchange.points_file import (
    UNITS,
    figure_size,
    guess_unit,
    read_names,
    read_points,
    with_y_up,
)
from appliance.studio.exchange.reading import read_as_given
from appliance.studio.exchange.topology import directions_at_rest, parents_by_name

_log = logging.getLogger(__name__)

USUAL_FPS = 50.0
_SHOWN_GAPS = 10
_FAR = 0.05  # fraction of the figure's size: a point moves less in a frame
_ROOT = ("spine", 0, 0)  # chain, side and place of the hips
_FEW_FRAMES = 2


@dataclass(frozen=True)
class PointsOptions:
    """names: file; model: recording whose skeleton the points belong to; up: 'y' or 'z'.

    None: fps as the file's times say, else 50; unit by the size of the figure.
    """

    names: Path | None = None
    model: Path | None = None
    fps: float | None = None
    unit: str | None = None
    up: str = "y"
    longest_gap_s: float = 0.5


@dataclass(frozen=True)
class Imported:
    """A dance, and the distances (N, J) in metres from its joints to the points, not a number in gaps."""

    recording: Recording
    errors: Array

    def report(self) -> list[str]:
        """The distances in centimetres, in lines: of all joints, then of each, the worst one first."""
        names = self.recording.skeleton.names
        width = max(map(len, names))
        lines = [f"Distance from the points, cm: {_figures(self.errors)}"]
        worst = np.argsort(-np.nanmean(self.errors, axis=0), kind="stable")
        return lines + [f"  {names[joint]:{width}}  {_figures(self.errors[:, joint])}" for joint in worst]


def _figures(errors: Array) -> str:
    cm = 100.0 * errors[~np.isnan(errors)]
    return f"mean {cm.mean():.2f}, 95 % below {np.percentile(cm, 95):.2f}, largest {cm.max():.2f}"


def import_points(source: Path, options: PointsOptions) -> Imported:
    """Read points, fit a skeleton, find its poses. Raises ExchangeError or BvhError."""
    listed = None if options.names is None else read_names(options.names)
    names, read, given_fps, notes = read_points(source, listed)
    for note in notes:
        _log.info(f"{source.name}: {note}.")
    fps = options.fps or given_fps or USUAL_FPS
    if options.fps is None:
        why = "by the column of times" if given_fps else "as nothing else is given"
        _log.info(f"Rate: {fps:g} frames a second, {why}. If that is wrong: --fps.")
    given = None if listed is None or listed.parents is None else listed.parents
    read = _with_zeros_as_gaps(names, given, read)
    _require_seen(source, names, read)
    unit = options.unit or guess_unit(read)
    if options.unit is None:
        _log.info(f"Unit: {unit}, by the size of the figure. If that is wrong: --unit {' | '.join(UNITS)}.")
    points = with_y_up(UNITS[unit] * read, options.up)
    _log.info(f"Points: {len(names)}, frames: {len(points)}, {len(points) / fps:.1f} s.")
    if options.model is not None:
        skeleton, points = _as_model(source, options.model, names, points)
    else:
        skeleton, points = _fitted(source, names, given, points)
    recording, too_long = pose_frames(skeleton, points, fps, options.longest_gap_s)
    _log_gaps(gaps_of(points), too_long, skeleton.names, fps)
    places, _ = skeleton.forward_kinematics(recording.poses, recording.roots)
    return Imported(recording, np.linalg.norm(places - points, axis=-1))


def _with_zeros_as_gaps(names: Sequence[str], parents: Sequence[str] | None, points: Array) -> Array:
    """Points (N, P, 3) where one that is exactly 0, 0, 0 for a while is a gap: it was not seen.

    A point that is there always is the origin of the others if it is the root; any other was never seen. A
    point that begins or arrives there, and not from afar, stays.
    """
    zero = (points == 0.0).all(axis=2)
    if not zero.any():
        return points
    size, places, found, unseen = figure_size(points), places_of(names), points.copy(), list[str]()
    for joint in np.flatnonzero(zero.any(axis=0)).tolist():
        always = bool(zero[:, joint].all())
        place = places[joint]
        root = parents[joint] == "" if parents is not None else place is not None and place[:3] == _ROOT
        if always and root:
            continue
        lone = points.copy()[:, [joint]]
        lone[zero[:, joint]] = np.nan
        for gap in [one for one in gaps_of(lone) if zero[one.first : one.last + 1, joint].any()]:
            around = lone[[k for k in (gap.first - 1, gap.last + 1) if 0 <= k < len(lone)], 0]
            if always or np.linalg.norm(around, axis=-1).max() > _FAR * size:
                found[gap.first : gap.last + 1, joint] = np.nan
                if not always:
                    frames = place_text(range(gap.first, gap.last + 1), "frame")
                    unseen.append(f"{names[joint]} is 0, 0, 0 in {frames}: taken as not seen.")
    for line in unseen[:_SHOWN_GAPS]:
        _log.info(line)
    if len(unseen) > _SHOWN_GAPS:
        _log.info(f"And {len(unseen) - _SHOWN_GAPS} more such points and times.")
    return found


def _require_seen(source: Path, names: Sequence[str], points: Array) -> None:
    seen = (~np.isnan(points).any(axis=2)).sum(axis=0)
    if (seen < min(_FEW_FRAMES, len(points))).any():
        never = [name for name, count in zip(names, seen, strict=True) if count < _FEW_FRAMES]
        raise ExchangeError(source, f"{', '.join(never)}: never seen. Leave the point out, of the names too.")


def _as_model(source: Path, model: Path, names: Sequence[str], points: Array) -> tuple[Skeleton, Array]:
    reading = ReadingOptions(true_fps={"*": USUAL_FPS})  # its dance is not asked for
    recording, guesses = read_as_given(model, reading)
    figure = recording.skeleton
    for guess in guesses:
        _log.info(f"{model.name}: {guess.sentence()}.")
    others = [name for name in names if name not in figure.names]
    if others:
        _log.info(f"Points that are no joints of {model.name} left out: {', '.join(others)}.")
    missing = [name for name in figure.names if name not in names]
    if missing:
        raise ExchangeError(
            source,
            f"{model.name} has joints that are no points: {', '.join(missing[:5])}. Rename the points, or "
            "take another skeleton.",
        )
    points = points[:, [list(names).index(name) for name in figure.names]]
    return like(figure, points), points


def _fitted(
    source: Path, names: Sequence[str], given: Sequence[str] | None, points: Array
) -> tuple[Skeleton, Array]:
    if given is not None:
        parents: list[int] | str = [list(names).index(name) if name else -1 for name in given]
    else:
        parents = parents_by_name(names)
    if isinstance(parents, str):
        raise ExchangeError(
            source,
            f"The names do not say what hangs on what ({parents}). Write the parent behind each name "
            "('LeftHand, LeftForeArm'; 'Hips, -' for the root), or take the skeleton of a recording: --like "
            "FILE.bvh.",
        )
    order = _parents_first(source, names, parents)
    place = {joint: row for row, joint in enumerate(order)}
    chosen = [names[joint] for joint in order]
    above = [place.get(parents[joint], -1) for joint in order]
    points = points[:, order]
    return fit_skeleton(chosen, above, points, directions_at_rest(chosen, above)), points


def _parents_first(source: Path, names: Sequence[str], parents: Sequence[int]) -> list[int]:
    """The joints depth first, as a BVH file has them. Raises ExchangeError without exactly one root."""
    roots = [joint for joint, parent in enumerate(parents) if parent < 0]
    if len(roots) != 1:
        found = ", ".join(names[joint] for joint in roots) or "none"
        raise ExchangeError(source, f"A figure has one root, without a parent; here: {found}.")

    def below(joint: int) -> list[int]:
        return [joint, *(n for child, above in enumerate(parents) if above == joint for n in below(child))]

    order = below(roots[0])
    if len(order) != len(names):
        lost = next(name for joint, name in enumerate(names) if joint not in order)
        raise ExchangeError(source, f"'{lost}' hangs on itself. Correct its parents.")
    return order


def _log_gaps(
    gaps: Sequence[Gap],
    too_long: Sequence[Gap],
    names: Sequence[str],
    fps: float,
) -> None:
    def text(gap: Gap) -> str:
        return f"{names[gap.joint]} in {place_text(range(gap.first, gap.last + 1), 'frame')}"

    short = [gap for gap in gaps if gap not in too_long]
    if short:
        longest = max(gap.last - gap.first + 1 for gap in short) / fps
        more = f" and {len(short) - _SHOWN_GAPS} more" if len(short) > _SHOWN_GAPS else ""
        shown = ", ".join(text(gap) for gap in short[:_SHOWN_GAPS])
        _log.info(f"Gaps: {len(short)} of up to {longest:.2f} s, crossed in straight lines: {shown}{more}.")
    for gap in too_long[:_SHOWN_GAPS]:
        seconds = (gap.last - gap.first + 1) / fps
        _log.info(
            f"{text(gap)} was not seen for {seconds:.2f} s, from {gap.first / fps:.2f} s on: its bone turns "
            "evenly from the pose before to the pose after. Look whether that can be danced."
        )
    if len(too_long) > _SHOWN_GAPS:
        _log.info(f"And {len(too_long) - _SHOWN_GAPS} more such gaps.")
