"""Five excerpts of 200 frames by measured criteria, as the paper chose them by eye (section 4).

Speeds are of the moving joints, heading removed, in degrees a second, means over the joints of a region and
over time. Coordination is the correlation of the arms' speed with the legs' speed over time, each smoothed
over 0.1 s, the largest within a lag of 0.25 s either way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.show.config_error import ConfigError
from appliance.show.yaml_file import read_yaml
from appliance.studio.data.dataset import FPS, WINDOW, Take
from appliance.studio.data.regions import Regions, regions_of
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.studio_error import StudioError

FRAMES = 200  # 4 s
STEP = 25  # frames from one candidate to the next
SMOOTHED, LAG = 5, 12  # ticks
LEAD = WINDOW - 1  # frames around an excerpt: the first and last windows reach that far


@dataclass(frozen=True)
class Measures:
    """The criteria for an excerpt: speeds in degrees a second, coordination -1 to 1."""

    whole: float
    torso: float
    arms: float
    legs: float
    coordination: float


@dataclass(frozen=True)
class Excerpt:
    """name: still, torso, uncoordinated, coordinated, partly; why, in words; FRAMES from `first` of a take.

    recording: those frames, with what `LEAD` windows need around them where the take has it.
    """

    name: str
    why: str
    take: str
    first: int
    measures: Measures
    recording: Recording

    def as_json(self) -> dict[str, object]:
        """For the report."""
        figures = {name: round(value, 3) for name, value in asdict(self.measures).items()}
        return {
            "why": self.why,
            "take": self.take,
            "first_frame": self.first,
            "seconds": [round(self.first / FPS, 2), round((self.first + FRAMES) / FPS, 2)],
            "measures": figures,
        }


WHY = {
    "still": "the least motion of all",
    "torso": "the torso bends while arms and legs hardly move",
    "uncoordinated": "arms and legs move, with the least in common",
    "coordinated": "arms and legs move most in step",
    "partly": "the whole body moves, coordinated in part",
}


def measured(poses: Array, regions: Regions) -> Measures:
    """From poses (T, M, 4) of the moving joints at 50 Hz, heading removed."""
    speeds = np.degrees(quaternion.angle_between(poses[1:], poses[:-1])) * FPS
    arms, legs = (_smoothed(speeds[:, places].mean(axis=1)) for places in (regions.arms, regions.legs))
    return Measures(
        whole=float(speeds.mean()),
        torso=float(speeds[:, regions.torso].mean()),
        arms=float(arms.mean()),
        legs=float(legs.mean()),
        coordination=max(_correlation(arms, legs, lag) for lag in range(-LAG, LAG + 1)),
    )


def choose(takes: Sequence[Take], joints: Sequence[str]) -> list[Excerpt]:
    """The five kinds, none overlapping another. Raises StudioError where the recordings are too short."""
    if not takes:
        raise StudioError("There is no recording to choose excerpts from.")
    skeleton = takes[0].recording.skeleton
    regions = regions_of(skeleton, joints, _NAME_THEM)
    places = [skeleton.index(name) for name in joints]
    candidates = [one for take in takes for one in _candidates(take, places, regions)]
    chosen: list[Excerpt] = []
    for name, criterion in _criteria([measures for _, _, measures in candidates]).items():
        free = [one for one in candidates if not any(_overlaps(one, other) for other in chosen)]
        if not free:
            raise StudioError(
                f"The recordings are too short for five excerpts of {FRAMES / FPS:g} s: {len(chosen)} fit. "
                "Give more or longer recordings, or name the excerpts with --excerpts."
            )
        take, first, measures = min(free, key=lambda one: criterion(one[2]))
        chosen.append(_excerpt(name, WHY[name], take, first, measures))
    return chosen


def named(file: Path, takes: Sequence[Take], joints: Sequence[str]) -> list[Excerpt]:
    """Excerpts that a YAML file names: `NAME: {take: salsa_09, start: 12.5}`, seconds of the take at 50 Hz.

    Raises ConfigError with the line, StudioError where the skeleton has no limbs.
    """
    entries = read_yaml(file)
    known, problems, found = {take.name: take for take in takes}, [], []
    for name, entry in entries.values.items():
        try:
            wanted = _Named.model_validate(entry)
            take, first = known[wanted.take], round(wanted.start * FPS)
        except ValidationError:
            problems.append(entries.problem((name,), f"'{name}' does not say where it is.", _EXAMPLE))
            continue
        except KeyError:
            problems.append(
                entries.problem(
                    (name,), f"There is no take '{wanted.take}'.", f"There are {', '.join(known)}."
                )
            )
            continue
        if first > len(take.recording) - FRAMES:
            longest = (len(take.recording) - FRAMES) / FPS
            message = f"{take.name} ends before an excerpt of {FRAMES / FPS:g} s that starts there."
            problems.append(
                entries.problem((name,), message, f"Start at {max(0.0, longest):.1f} s at the latest.")
            )
            continue
        skeleton = take.recording.skeleton
        places = [skeleton.index(joint) for joint in joints]
        poses = without_heading(take.recording.poses[first : first + FRAMES, places])
        found.append(
            _excerpt(
                name,
                "named in a file",
                take,
                first,
                measured(poses, regions_of(skeleton, joints, _NAME_THEM)),
            )
        )
    if problems or not found:
        raise ConfigError(problems or [entries.problem((), "It names no excerpt.", _EXAMPLE)])
    return found


_Candidate = tuple[Take, int, Measures]
_NAME_THEM = "Name the excerpts yourself with --excerpts."
_EXAMPLE = "Write a take and its start in seconds: still: {take: salsa_09, start: 12.5}."


class _Named(BaseModel):
    """Entries of an excerpts file."""

    take: str
    start: float = Field(ge=0, allow_inf_nan=False)


def _candidates(take: Take, places: list[int], regions: Regions) -> list[_Candidate]:
    poses = without_heading(take.recording.poses[:, places])
    sound = take.sound
    firsts = range(LEAD, len(poses) - FRAMES - LEAD + 1, STEP)
    return [
        (take, first, measured(poses[first : first + FRAMES], regions))
        for first in firsts
        if sound[first - LEAD : first + FRAMES + LEAD].all()
    ]


def _criteria(known: Sequence[Measures]) -> dict[str, Callable[[Measures], float]]:
    """For each kind, in the order of choosing: the least value for the excerpt that shows it best."""
    if not known:
        return {name: lambda one: one.whole for name in WHY}
    limbs = np.percentile([min(one.arms, one.legs) for one in known], 50)
    whole, torso = (
        np.percentile([one.whole for one in known], 67),
        np.percentile([one.torso for one in known], 25),
    )
    middle = float(np.median([one.coordination for one in known]))

    def unless(fits: bool, cost: float) -> float:
        return cost if fits else 1e6 + cost

    return {
        "still": lambda one: one.whole,
        "torso": lambda one: unless(one.torso >= torso, max(one.arms, one.legs) / max(one.torso, 1e-6)),
        "uncoordinated": lambda one: unless(min(one.arms, one.legs) >= limbs, one.coordination),
        "coordinated": lambda one: unless(min(one.arms, one.legs) >= limbs, -one.coordination),
        "partly": lambda one: unless(one.whole >= whole, abs(one.coordination - middle)),
    }


def _overlaps(candidate: _Candidate, other: Excerpt) -> bool:
    return candidate[0].name == other.take and abs(candidate[1] - other.first) < FRAMES


def _excerpt(name: str, why: str, take: Take, first: int, measures: Measures) -> Excerpt:
    begin, end = max(0, first - LEAD), min(len(take.recording), first + FRAMES + LEAD)
    recording = take.recording.excerpt(begin / FPS, end / FPS)
    return Excerpt(name, why, take.name, first, measures, recording)


def _smoothed(values: Array) -> Array:
    smooth: Array = np.convolve(values, np.ones(SMOOTHED) / SMOOTHED, mode="valid")
    return smooth


def _correlation(a: Array, b: Array, lag: int) -> float:
    """Pearson's, of a at a time and b `lag` ticks later; 0 where one of them stands still."""
    if lag < 0:
        return _correlation(b, a, -lag)
    one, other = a[: len(a) - lag], b[lag:]
    spread: NDArray[np.float64] = one.std() * other.std()
    return 0.0 if spread < 1e-9 else float(((one - one.mean()) * (other - other.mean())).mean() / spread)
