"""A mapping at work: its rules turn the dance into values, which fade into those of the next mapping."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from appliance.lights.colour import between, mixed
from appliance.lights.dance import Dances
from appliance.lights.patch import Indices, Patch, Values
from appliance.pose.ease import ease
from appliance.show.light_rules import AIM, COLOUR, MappingConfig, RuleConfig

Mask = NDArray[np.bool_]
Array = NDArray[np.float64]
SPARED_M = 0.35  # around the dancer's eyes
SEES_WITHIN = math.radians(60.0)  # around the gaze: light from farther aside does not blind


@dataclass(frozen=True)
class MappingOutput:
    """The output of a mapping: slots (S,) 0..1; points to aim at (H, 3), metres; which heads it moves."""

    values: Values
    aims: NDArray[np.float64]
    aimed: Mask  # (H,)
    steered: Mask  # (A,) pan and tilt slots that rules set directly


class Mapping:
    """A set of rules. Slots that no rule drives rest at their defaults; heads that none moves hold."""

    def __init__(self, config: MappingConfig, patch: Patch) -> None:
        self.name = config.name
        self._patch = patch
        driven = np.zeros(len(patch.slots), bool)
        self._rules: list[_Rule | _Aim] = []
        aimed = np.zeros(len(patch.heads.heads), bool)
        steered = np.zeros(len(patch.heads.axes.slots), bool)
        for rule in config.rules:
            if rule.drives == AIM:
                aim = _Aim(rule, patch)
                self._rules.append(aim)
                aimed[aim.heads] = True
                continue
            one = _Rule(rule, patch, driven)
            self._rules.append(one)
            driven[one.slots] = True
            axes = np.isin(patch.heads.axes.slots, one.slots)
            steered |= axes
            aimed &= ~(axes[patch.heads.pans] | axes[patch.heads.tilts])  # the later rule counts
        self._aimed, self._steered = aimed, steered

    def restart(self) -> None:
        """Comes into force: the first pass takes readings as they are, without attack and release."""
        for rule in self._rules:
            rule.restart()

    def evaluate(self, dances: Dances, seconds: float) -> MappingOutput:
        """The rules' output now, `seconds` after the pass before."""
        output = MappingOutput(
            self._patch.defaults.copy(), np.zeros((len(self._aimed), 3)), self._aimed, self._steered
        )
        for rule in self._rules:
            rule.apply(dances, seconds, output)
        return output


def faded(before: MappingOutput, after: MappingOutput, part: float, snaps: Mask) -> MappingOutput:
    """Crossfade of two mappings at `part` 0..1; slots in `snaps` (S,) jump halfway.

    Points to aim at slide across the stage; a head that only one of them moves follows that one.
    """
    if part >= 1.0:
        return after
    weight = np.where(snaps, float(part >= 0.5), part)
    values = before.values + (after.values - before.values) * weight
    aims = before.aims + (after.aims - before.aims) * part
    aims[~after.aimed] = before.aims[~after.aimed]
    aims[~before.aimed] = after.aims[~before.aimed]
    newest = after if part >= 0.5 else before
    aimed = np.where(before.aimed & after.aimed, True, newest.aimed)
    return MappingOutput(values, aims, aimed, newest.steered)


class _Rule:
    """A rule that drives slots by a number."""

    def __init__(self, config: RuleConfig, patch: Patch, driven: Mask) -> None:
        self.slots: Indices = patch.select(config.fixtures, config.drives)
        self._config = config
        self._components = patch.components[self.slots] if config.drives == COLOUR else None
        self._colours = np.array(config.colours or [(1.0, 1.0, 1.0)])
        self._again = driven[self.slots] if config.mix != "last" else np.zeros(len(self.slots), bool)
        self._level: float | None = None

    def restart(self) -> None:
        self._level = None

    def apply(self, dances: Dances, seconds: float, output: MappingOutput) -> None:
        config = self._config
        if config.reads == "steady":
            wanted = config.value
        else:
            wanted = bent(config, share(dances.read(config), config.ends))
        if self._level is not None:
            wanted = eased(self._level, wanted, *config.eases_s, seconds)
        self._level = wanted
        low, high = config.output
        level = low + (high - low) * wanted
        shown = np.full(len(self.slots), level)
        if self._components is not None:
            shown = mixed(between(self._colours, level))[self._components]
        earlier = output.values[self.slots]
        output.values[self.slots] = np.where(self._again, _MIXES[config.mix](earlier, shown), shown)


class _Aim:
    """A rule that points heads at a joint or at a point of the stage."""

    def __init__(self, config: RuleConfig, patch: Patch) -> None:
        self.heads = [
            place
            for place, head in enumerate(patch.heads.heads)
            if not config.fixtures or head.fixture.name in config.fixtures
        ]
        self._joint, self._puppet = config.joint, config.puppet
        self._point = None if config.reads == "place" else np.array(config.at)
        self._offset = np.array(config.offset)
        self._places = patch.heads.places[self.heads]

    def restart(self) -> None:
        """Nothing to reset: only the heads' own speed limits an aim."""

    def apply(self, dances: Dances, seconds: float, output: MappingOutput) -> None:
        dance = dances.of(self._puppet)
        point = (dance.place(self._joint) if self._point is None else self._point) + self._offset
        output.aims[self.heads] = point
        if (eyes := dance.eyes) is not None:
            for head, place in zip(self.heads, self._places, strict=True):
                output.aims[head, 1] -= _below_eyes(place, point, *eyes)


def _below_eyes(place: Array, point: Array, eyes: Array, gaze: Array) -> float:
    """How much lower a head at `place` aims than at `point`, so that it does not blind the dancer, metres.

    A beam that comes from where the dancer looks and would pass the eyes closer than SPARED_M goes below
    them. Heads move no faster than they can, so that the beam swings there.
    """
    to_eyes, to_point = eyes - place, point - place
    far = float(np.linalg.norm(to_eyes))
    if far < SPARED_M or float(gaze @ to_eyes) > -math.cos(SEES_WITHIN) * far:
        return 0.0
    reach = float(to_point @ to_eyes) / far  # how far the aim is along the way to the eyes
    if reach <= 0.0:
        return 0.0
    off = to_point * (far / reach) - to_eyes  # where the beam passes, from the eyes
    if math.hypot(float(off[0]), float(off[2])) > SPARED_M or abs(float(off[1])) > SPARED_M:
        return 0.0
    return (SPARED_M + float(off[1])) * reach / far


_MIXES: dict[str, Callable[[Values, Values], Values]] = {
    "last": lambda earlier, shown: shown,
    "highest": np.maximum,
    "sum": lambda earlier, shown: np.minimum(earlier + shown, 1.0),
    "product": np.multiply,
}


def mappings_of(configs: Sequence[MappingConfig], patch: Patch) -> dict[str, Mapping]:
    """All mappings of a show by name, in order; one without rules where the show has none."""
    return {config.name: Mapping(config, patch) for config in configs or [MappingConfig(name="none")]}


def share(reading: float, ends: tuple[float, float]) -> float:
    """How far a reading is from the first to the second end, 0..1; the ends may fall."""
    return min(max((reading - ends[0]) / (ends[1] - ends[0]), 0.0), 1.0)


def bent(rule: RuleConfig, value: float) -> float:
    """The rule's curve: 0..1 -> 0..1."""
    if rule.curve == "s":
        return ease(value)
    if rule.curve == "gamma":
        return float(value**rule.gamma)
    if rule.curve == "points":
        return _between(rule.points, value)
    return value


def eased(before: float, wanted: float, attack_s: float, release_s: float, seconds: float) -> float:
    """The next value after `seconds`: a rise of 1 takes attack_s, a fall of 1 release_s; 0 s is at once."""
    over_s = attack_s if wanted > before else release_s
    if over_s <= 0.0:
        return wanted
    most = seconds / over_s
    return before + min(max(wanted - before, -most), most)


def _between(points: list[tuple[float, float]], value: float) -> float:
    """Straight lines between corners [in, out]; level before the first and behind the last."""
    if value <= points[0][0]:
        return points[0][1]
    for (x0, y0), (x1, y1) in pairwise(points):
        if value <= x1:
            return y0 + (y1 - y0) * (value - x0) / (x1 - x0)
    return points[-1][1]
