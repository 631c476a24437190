"""A walk through the rig: fixture by fixture, attribute by attribute, each with what to look for."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.lights.patch import Patch, Values
from appliance.lights.slot import Slot
from appliance.show.fixture_profile import DIMMER, PAN, TILT
from appliance.show.light_rules import AIM
from appliance.show.venue_lights import UNIVERSE_CHANNELS

_log = logging.getLogger(__name__)

LONGEST_STEP_S = 0.04  # time step; a late one continues where it was, so that no peak is skipped
_ROOM = 2.2  # sweeps from end to end that a head gets time for; it makes two
CHEST_M = 1.2  # heads point here at the end, at chest height above the origin


@dataclass(frozen=True)
class Step:
    """One thing to look at. `place`: the slot that moves; -1: all heads of the fixture aim."""

    fixture: str
    attribute: str
    description: str
    place: int


def steps(patch: Patch, fixtures: Sequence[str] = (), attribute: str | None = None) -> Iterator[Step]:
    """Steps of the walk, in patch order; empty `fixtures` or None for `attribute`: all."""
    for fixture in patch.fixtures:
        if fixtures and fixture.name not in fixtures:
            continue
        for place, slot in enumerate(patch.slots):
            if slot.fixture is fixture and attribute in (None, slot.name, slot.base):
                yield Step(fixture.name, slot.name, _meaning(slot), place)
        if any(head.fixture is fixture for head in patch.heads.heads) and attribute in (None, AIM):
            description = f"points at the origin of the stage, {CHEST_M:g} m above the floor"
            yield Step(fixture.name, AIM, description, -1)


def introduction(patch: Patch, fixture: str) -> str:
    """A fixture in one line: profile, universe, channels."""
    own = next(one for one in patch.fixtures if one.name == fixture)
    channels = [channel for slot in patch.slots if slot.fixture is own for channel in slot.channels]
    first, last = min(channels) % UNIVERSE_CHANNELS + 1, max(channels) % UNIVERSE_CHANNELS + 1
    return f"{fixture} ({own.profile}): universe {own.universe}, channels {first} to {last}"


class Walk:
    """Levels during a step: only its fixture is lit, and its attribute moves."""

    def __init__(self, patch: Patch) -> None:
        self._patch = patch
        self._aims: NDArray[np.float64] = np.tile([0.0, CHEST_M, 0.0], (len(patch.heads.heads), 1))
        self.values: Values = patch.rest()  # (S,) what the last pass showed

    def levels(self, step: Step, part: float, seconds: float) -> dict[int, bytes]:
        """512 levels for each universe, `part` 0..1 of the step and `seconds` after the levels before."""
        patch, heads = self._patch, self._patch.heads
        values = self._lit(step.fixture)
        if step.place >= 0:
            values[step.place] = self._moved(step, part)
            self._alone(step, values)
        aimed = np.array([step.place < 0 and head.fixture.name == step.fixture for head in heads.heads], bool)
        heads.follow(heads.axes.angles(values), self._aims, aimed, seconds)
        shown = patch.dimmed(values, 1.0)
        shown[heads.axes.slots] = heads.axes.shares(heads.angles)
        self.values = shown
        return patch.encode(shown)

    def dark(self) -> dict[int, bytes]:
        return {universe: bytes(UNIVERSE_CHANNELS) for universe in self._patch.universes}

    def _lit(self, fixture: str) -> Values:
        """Everything at its default, the dimmers of this fixture open, all others shut."""
        patch = self._patch
        values = patch.defaults.copy()
        values[patch.dims] = 0.0
        own = np.array([slot.fixture.name == fixture and slot.base == DIMMER for slot in patch.slots], bool)
        values[own] = 1.0
        return values

    def duration_s(self, step: Step, at_least_s: float) -> float:
        """How long a step takes; a head needs time for its whole range and back."""
        axes = self._patch.heads.axes
        place = np.flatnonzero(axes.slots == step.place)
        needed_s: list[float] = (_ROOM * axes.degrees[place] / axes.slew[place]).tolist()
        return max([at_least_s, *needed_s])

    def _moved(self, step: Step, part: float) -> float:
        """From where it rests to one end, to the other, and back."""
        if self._patch.slots[step.place].base in (PAN, TILT):
            rest = 0.5
        else:
            rest = 0.0 if step.attribute == DIMMER else float(self._patch.defaults[step.place])
        return float(np.interp(part, (0.0, 0.25, 0.75, 1.0), (rest, 0.0, 1.0, rest)))

    def _alone(self, step: Step, values: Values) -> None:
        """A colour is shown without the others."""
        patch, moved = self._patch, self._patch.slots[step.place]
        if not moved.is_lamp:
            return
        for place, slot in enumerate(patch.slots):
            if slot.fixture is moved.fixture and slot.is_lamp and place != step.place:
                values[place] = 0.0


def _meaning(slot: Slot) -> str:
    channels = [f"{channel % UNIVERSE_CHANNELS + 1}" for channel in slot.channels]
    where = f"channel {' and '.join(channels)}" if channels else "by its colours"
    if slot.base in (PAN, TILT):
        return f"{where}: from the middle to one end, to the other end, and back"
    if slot.is_lamp:
        return f"{where}: only this colour, up and down"
    return f"{where}: dark, full, back" if slot.base == DIMMER else f"{where}: from 0 to full, and back"


class Walking:
    """A walk, pass by pass: each step takes `step_s`, or as long as its heads need.

    step: the fixture and attribute that move now; None before the first pass and after the last step.
    """

    def __init__(self, patch: Patch, to_see: Sequence[Step], step_s: float, rate_hz: float) -> None:
        self._moving, self._to_see, self._step_s = Walk(patch), iter(to_see), step_s
        self._longest_s = max(LONGEST_STEP_S, 1.5 / rate_hz)
        self._before = self._walked_s = self._duration_s = 0.0
        self.step: Step | None = None

    @property
    def values(self) -> Values:
        """(S,) what the last pass showed."""
        return self._moving.values

    def levels(self, now: float) -> dict[int, bytes]:
        """512 levels for each universe at `now` (monotonic seconds); zeros after the last step."""
        seconds, self._before = min(now - self._before, self._longest_s), now
        self._walked_s += seconds
        if self.step is None or self._walked_s >= self._duration_s:
            self.step, self._walked_s, seconds = next(self._to_see, None), 0.0, 0.0
            if self.step is not None:
                self._duration_s = self._moving.duration_s(self.step, self._step_s)
        if self.step is None:
            return self._moving.dark()
        return self._moving.levels(self.step, self._walked_s / self._duration_s, seconds)


def walk(
    patch: Patch,
    to_see: Sequence[Step],
    step_s: float,
    rate_hz: float,
    show: Callable[[dict[int, bytes]], float],
    stopped: Callable[[], bool],
) -> None:
    """Take the steps, `step_s` each or as long as heads need, at `rate_hz`.

    `show` sends levels, waits for the next pass and gives the time then.
    """
    walking, said = Walking(patch, to_see, step_s, rate_hz), None
    dark = Walk(patch).dark()
    now = show(dark)
    while not stopped():
        levels = walking.levels(now)
        if walking.step is None:
            break
        if walking.step is not said:
            if said is None or walking.step.fixture != said.fixture:
                _log.info(introduction(patch, walking.step.fixture))
            said = walking.step
            _log.info(f"  {said.attribute}, {said.description}")
        now = show(levels)
    show(dark)
