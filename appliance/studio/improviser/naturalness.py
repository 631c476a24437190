"""How natural a generated dance is: its pace, smoothness, range, footing and seam against the recordings'."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.grounding import GroundingError, survey
from appliance.dancer.loop import is_closed, turns_about_y, yaws
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, Take
from appliance.studio.improviser.pace import Pace, mean_pace, mean_speed, pace
from appliance.studio.standing import Standing, measure_standing
from appliance.studio.studio_error import StudioError

EVERY_S = 0.2  # between two poses that are compared
SECOND_S = 1.0  # length of the stretches that are searched for in the recordings
MOST_COMPARED = 6000  # poses of 20 minutes; with all poses of 80 minutes their distances would take 15 GB
SECONDS_A_POSE = 5  # stretches of a second that begin between two poses that are compared
SHORTEST_S = 2.0
_DISTANCES_AT_ONCE = 1 << 23  # 64 MB


@dataclass(frozen=True)
class Likeness:
    """How a motion's poses lie among the recorded ones; distances are root mean squares over joints."""

    breadth: float  # spread of its poses about their mean, over that of the recordings
    coverage: float  # share of recorded poses to which it comes as near as another take does
    strangeness: float  # distance of its poses from the nearest recorded ones, over that of another take's
    strangeness_p99: float
    nearest_second_cm: float  # from each of its seconds to the nearest recorded one: 0 would be a copy
    recorded_nearest_second_cm: float  # the same between a take and the others


@dataclass(frozen=True)
class Seam:
    """The step from the last frame to the first, and the largest one in the half second around it."""

    closed: bool  # whether the box plays it as a closed loop
    degrees: float  # speed of the joint that turns most
    around_degrees: float
    root_cm: float
    around_root_cm: float


@dataclass(frozen=True)
class Naturalness:
    """Measures of a phrase, with those of the recordings where one figure means little."""

    seconds: float
    pace: Pace
    recorded_pace: Pace
    liveliness: float  # mean speed over that of the recordings
    likeness: Likeness
    slide_cm_s: float
    recorded_slide_cm_s: float
    float_cm: float
    recorded_float_cm: float
    penetration_cm: float
    worst_penetration_cm: float
    stage_m: tuple[float, float]  # how wide and how deep the root's path is
    seam: Seam | None  # where an endless phrase begins anew

    def as_json(self) -> dict[str, object]:
        return asdict(self)


@dataclass(frozen=True)
class Yardstick:
    """Measures of the recordings, with which phrases are compared.

    pace, slide, float: their own, glitches left out; shapes (K, M * 3): figures of theirs, centimetres; near
    (K,): how far each is from the nearest one of another take; seconds: stretches of a second; shape_speed:
    of whole figures, centimetres a second, root of the sum over joints.
    """

    moving: tuple[int, ...]
    pace: Pace
    slide_cm_s: float
    float_cm: float
    shapes: Array
    near: Array
    seconds: Array
    nearest_second_cm: float
    shape_speed: float

    @staticmethod
    def of(takes: Sequence[Take], moving: Sequence[int]) -> Yardstick:
        """Measure the takes. Raises StudioError where no stretch is long enough."""
        parts = [part for take in takes for part in sound_parts(take)]
        if not parts:
            raise StudioError(
                f"No recording has {SHORTEST_S:g} s without a capture error to compare a dance with. Give "
                "longer or cleaner ones, or --all-frames."
            )
        names = [take.take for take in takes for _ in sound_parts(take)]
        usual_speed = mean_speed(parts, moving)
        paces = [pace(part, moving, usual_speed) for part in parts]
        stood = [standing_of(part) for part in parts]
        shapes = [figure_shapes(part, moving) for part in parts]
        speeds = [np.linalg.norm(np.diff(shape, axis=0), axis=1).mean() * FPS for shape in shapes]
        lengths = [len(part) for part in parts]
        every = max(round(EVERY_S * FPS), -(-sum(lengths) // MOST_COMPARED))
        few = [shape[::every] for shape in shapes]
        seconds = [seconds_of(shape, every // SECONDS_A_POSE) for shape in shapes]
        some = max(1, sum(len(part) for part in seconds) // 200)
        among = _to_others(few, names)
        return Yardstick(
            tuple(moving),
            mean_pace(paces, lengths),
            float(np.average([one.slide_cm_s for one in stood], weights=lengths)),
            float(np.average([one.float_cm for one in stood], weights=lengths)),
            np.concatenate(few),
            np.where(np.isfinite(among), among, _middle_of_finite(among)),
            np.concatenate(seconds),
            _mean_of_finite(_to_others(seconds, names, some)),
            float(np.average(speeds, weights=lengths)),
        )

    @property
    def usual_cm(self) -> float:
        """How far a recorded figure is from the nearest one of another take."""
        return float(np.median(self.near))

    def strangeness(self, shapes: Array) -> Array:
        """(N,) of figures (N, M * 3): distance to the nearest recorded one; 1 is usual between takes."""
        strange: Array = distances(shapes, self.shapes).min(axis=1) / self.usual_cm
        return strange


def measure(phrase: Recording, yardstick: Yardstick, endless: bool = True) -> Naturalness:
    """Measure a phrase at 50 Hz against the recordings that its networks learned from."""
    own = pace(phrase, yardstick.moving, yardstick.pace.speed, cyclic=endless)
    standing = standing_of(phrase)
    wide, deep = np.ptp(phrase.roots[:, [0, 2]], axis=0).tolist()
    return Naturalness(
        seconds=phrase.seconds,
        pace=own,
        recorded_pace=yardstick.pace,
        liveliness=own.speed / yardstick.pace.speed,
        likeness=_likeness(figure_shapes(phrase, yardstick.moving), yardstick),
        slide_cm_s=standing.slide_cm_s,
        recorded_slide_cm_s=yardstick.slide_cm_s,
        float_cm=standing.float_cm,
        recorded_float_cm=yardstick.float_cm,
        penetration_cm=standing.penetration_cm,
        worst_penetration_cm=standing.worst_penetration_cm,
        stage_m=(wide, deep),
        seam=_seam(phrase) if endless else None,
    )


def standing_of(recording: Recording) -> Standing:
    """Feet against the recording's own floor; a jump is no float. Not a number without named feet."""
    try:
        floor = survey(recording)
    except GroundingError:
        return Standing(*[float("nan")] * len(fields(Standing)))
    poses, roots = recording.poses, recording.roots
    return measure_standing(recording.skeleton, poses, roots, floor, floor.lifts, recording.fps)


def sound_parts(take: Take, shortest_s: float = SHORTEST_S) -> list[Recording]:
    """The stretches of a take without a glitch."""
    recording, fps = take.recording, take.recording.fps
    return [recording.excerpt(a / fps, b / fps) for a, b in take.sound_runs if b - a >= shortest_s * fps]


def figure_shapes(recording: Recording, moving: Sequence[int]) -> Array:
    """Positions (N, M * 3) in centimetres of the moving joints, seen from the hip, facing ahead."""
    poses = recording.poses.copy()
    facing = yaws(quaternion.heading(poses[:, 0]))
    poses[:, 0] = quaternion.multiply(turns_about_y(-facing), poses[:, 0])
    positions, _ = recording.skeleton.forward_kinematics(poses, np.zeros((len(poses), 3)))
    return 100 * positions[:, list(moving)].reshape(len(poses), -1)


def _likeness(phrase: Array, yardstick: Yardstick) -> Likeness:
    few = phrase[:: round(EVERY_S * FPS)]
    covered = distances(few, yardstick.shapes).min(axis=0) <= np.maximum(yardstick.near, yardstick.usual_cm)
    strange = yardstick.strangeness(few)
    whole_seconds = seconds_of(phrase, round(SECOND_S * FPS) // 2)
    seconds = distances(whole_seconds, yardstick.seconds).min(axis=1)
    spread, usual_spread = (np.sqrt(shapes.var(axis=0).sum()) for shapes in (phrase, yardstick.shapes))
    return Likeness(
        breadth=float(spread / usual_spread),
        coverage=float(covered.mean()),
        strangeness=float(strange.mean()),
        strangeness_p99=float(np.percentile(strange, 99)),
        nearest_second_cm=float(seconds.mean()) if len(seconds) else float("nan"),
        recorded_nearest_second_cm=yardstick.nearest_second_cm,
    )


def _to_others(parts: Sequence[Array], names: Sequence[str], every: int = 1) -> Array:
    """Distance of every `every`-th row to the nearest row of a part with another name, or inf."""
    owners = np.concatenate([[name] * len(part) for name, part in zip(names, parts, strict=True)])
    rows = np.concatenate(parts)
    other = owners[::every, None] != owners[None]
    nearest: Array = np.where(other, distances(rows[::every], rows), np.inf).min(axis=1)
    return nearest


def _middle_of_finite(values: Array) -> float:
    """Median; 1 cm where all recordings are one take."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else 1.0


def _mean_of_finite(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else 0.0


def distances(a: Array, b: Array) -> Array:
    """(A, B): root mean square over joints of the distance between figures (A, J * 3) and (B, J * 3)."""
    squared = (a * a).sum(1)[:, None] + (b * b).sum(1)[None] - 2 * a @ b.T
    root: Array = np.sqrt(np.maximum(squared, 0) / (a.shape[1] / 3))
    return root


def nearest(a: Array, b: Array) -> tuple[Array, NDArray[np.intp]]:
    """(A,) each: the distance of figures (A, J * 3) from the nearest of (B, J * 3), and which one that is."""
    found, places = np.empty(len(a)), np.empty(len(a), np.intp)
    at_once = max(1, _DISTANCES_AT_ONCE // max(1, len(b)))
    for first in range(0, len(a), at_once):
        rows = slice(first, first + at_once)
        apart = distances(a[rows], b)
        found[rows], places[rows] = apart.min(axis=1), apart.argmin(axis=1)
    return found, places


def seconds_of(shapes: Array, stride: int) -> Array:
    """Stretches of a second, one every `stride` frames, each as ten figures in a row (K, 10 * M * 3)."""
    length = round(SECOND_S * FPS)
    starts = np.arange(0, len(shapes) - length + 1, stride)
    moments = np.linspace(0, length - 1, 10).round().astype(int)
    seconds: Array = shapes[starts[:, None] + moments].reshape(len(starts), len(moments) * shapes.shape[1])
    return seconds


def _seam(phrase: Recording) -> Seam:
    around = np.arange(-round(0.25 * phrase.fps), round(0.25 * phrase.fps))
    poses, roots = phrase.poses[around], phrase.roots[around]
    turns = np.degrees(quaternion.angle_between(poses[1:], poses[:-1])).max(axis=1)
    moves = 100 * np.linalg.norm(np.diff(roots, axis=0), axis=1)
    at = len(around) // 2 - 1
    closed = is_closed(phrase.poses.astype(np.float32), phrase.roots.astype(np.float32))
    return Seam(closed, float(turns[at]), float(turns.max()), float(moves[at]), float(moves.max()))
