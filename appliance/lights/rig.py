"""The rig: one pass from the newest frame and the show state to the levels of all universes."""

from __future__ import annotations

import numpy as np

from appliance.box.pace import Pace
from appliance.box.show_state import ShowState
from appliance.lights.colour import mixed
from appliance.lights.dance import Dance
from appliance.lights.head import LONGEST_STEP_S
from appliance.lights.mapping import Mapping, Wishes, faded, mappings_of
from appliance.lights.patch import Patch, Values
from appliance.outputs.frame_reader import SeenFrame
from appliance.pose.skeleton import Skeleton
from appliance.show.fixture_profile import DIMMER
from appliance.show.lights import LightsConfig, SafeConfig

SAFE_FADE_S = 1.0  # into the safe look and back; panic is at once
LEAVING_FADE_S = 0.7
USUAL_RATE_HZ = 40.0
LOST_S = 1.0  # without a fresh frame for so long the stage counts as lost
MOST_LAYERS = 4  # mappings that fade into each other when the next one is called before the last is there


class Rig:
    """Fixtures, mappings and the safe look. It begins in the safe look and fades in with the first frame.

    rate_hz: how often passes are meant to come. One that comes much later than those before was held up, most
    often with the whole machine: it goes on by LONGEST_STEP_S, and no more counts against a stage that was
    held up as well.
    """

    def __init__(
        self, config: LightsConfig, patch: Patch, skeleton: Skeleton, rate_hz: float = USUAL_RATE_HZ
    ) -> None:
        self.patch = patch
        self.dance = Dance(skeleton)
        self.safety = 1.0  # 0: the dance alone; 1: the safe look alone
        self._safe, self._homes = _safe_look(config.safe, patch), config.safe.heads == "home"
        self.values: Values = patch.dimmed(self._safe, 1.0)  # (S,) what the last pass showed
        self._is_dark = config.safe.dimmer == 0.0
        self._mappings = mappings_of(config.mappings, patch)
        self._layers: list[_Layer] = []
        self._called: tuple[str, float] | None = None
        self._unseen_s = np.inf  # how old the newest frame is, without what held up this process
        self._pace = Pace(LONGEST_STEP_S, rate_hz)
        self._leaving = False

    def leave(self) -> None:
        """From now on passes fade to the safe look, whatever dances."""
        self._leaving = True

    @property
    def is_lost(self) -> bool:
        """Whether the stage has shown nothing for LOST_S."""
        return self._unseen_s > LOST_S

    def pass_(
        self, frame: SeenFrame | None, generation: int, show_state: ShowState, now: float
    ) -> dict[int, bytes]:
        """512 levels for each universe at `now`, monotonic seconds; `generation` is that of the stage."""
        seconds = self._pace.step_s(now)
        self._unseen_s += seconds
        if frame is not None:
            self.dance.see(frame, generation, now)
            self._unseen_s = min(self._unseen_s, now - frame.frame_time)
        self._secure(show_state, now, seconds)
        wishes = self._wishes(show_state, now, seconds)
        safety = self.safety
        danced = self.patch.dimmed(wishes.values, show_state.level(now)) if safety < 1.0 else wishes.values
        safe = self.patch.dimmed(self._safe, _safe_level(show_state))
        self.values = danced + (safe - danced) * np.where(self.patch.snaps, float(safety >= 0.5), safety)
        self._turn_heads(wishes, seconds)
        return self.patch.encode(self.values)

    def last_levels(self, show_state: ShowState) -> dict[int, bytes]:
        """What is left on the wires at the end: the safe look where it has light in it, else zeros.

        Blackout takes the light out of it, as in each pass. Heads stay where they point: at zero they would
        swing to the end of their range.
        """
        heads = self.patch.heads
        is_dark = self._is_dark or not _safe_level(show_state)
        values = self.patch.rest() if is_dark else self.patch.dimmed(self._safe, 1.0)
        values[heads.axes.slots] = heads.axes.shares(heads.angles)
        return self.patch.encode(values)

    def _secure(self, show_state: ShowState, now: float, seconds: float) -> None:
        """How much of the safe look is there: at once on panic, faded else."""
        if show_state.panic:
            self.safety = 1.0
        elif self._leaving:
            self.safety = min(self.safety + seconds / LEAVING_FADE_S, 1.0)
        elif self.is_lost or show_state.is_safe(now):
            self.safety = min(self.safety + seconds / SAFE_FADE_S, 1.0)
        else:
            self.safety = max(self.safety - seconds / SAFE_FADE_S, 0.0)

    def _turn_heads(self, wishes: Wishes, seconds: float) -> None:
        """Heads follow; in the safe look they hold, or go home."""
        heads = self.patch.heads
        wanted, aimed = heads.angles, wishes.aimed
        if self.safety < 1.0:
            wanted = np.where(wishes.steered, heads.axes.angles(wishes.values), heads.angles)
        else:
            aimed = np.zeros_like(aimed)
            wanted = heads.axes.angles(self._safe) if self._homes else heads.angles
        heads.follow(wanted, wishes.aims, aimed, seconds)
        self.values[heads.axes.slots] = heads.axes.shares(heads.angles)

    def _wishes(self, show_state: ShowState, now: float, seconds: float) -> Wishes:
        """What the mapping in force wants, faded in from those before it."""
        self._call(show_state)
        mappings = {layer.mapping for layer in self._layers}  # each once, though it may fade out and in again
        wanted = {mapping: mapping.wishes(self.dance, seconds) for mapping in mappings}
        wishes = wanted[self._layers[0].mapping]
        for layer in self._layers[1:]:
            wishes = faded(wishes, wanted[layer.mapping], layer.part(now), self.patch.snaps)
        done = [place for place, layer in enumerate(self._layers) if layer.part(now) >= 1.0]
        self._layers = self._layers[done[-1] :]
        return wishes

    def _call(self, show_state: ShowState) -> None:
        """Lay the mapping that show control has called over those that are still fading."""
        called = (show_state.lights, show_state.lights_since)
        if called == self._called:
            return
        before, self._called = self._called, called
        if before is None:
            self._layers = [_Layer(self._mapping(show_state.lights_before), -np.inf, 0.0)]
        mapping = self._mapping(show_state.lights)
        if mapping is self._layers[-1].mapping:
            return
        mapping.begin()
        self._layers.append(_Layer(mapping, show_state.lights_since, show_state.lights_fade_s))
        self._layers = self._layers[-MOST_LAYERS:]

    def _mapping(self, name: str) -> Mapping:
        return self._mappings.get(name) or next(iter(self._mappings.values()))


class _Layer:
    """A mapping that fades in over what was there before."""

    def __init__(self, mapping: Mapping, since: float, fade_s: float) -> None:
        self.mapping, self._since, self._fade_s = mapping, since, fade_s

    def part(self, now: float) -> float:
        """0..1: how much of it is there."""
        if self._fade_s <= 0.0:
            return 1.0
        return min(max((now - self._since) / self._fade_s, 0.0), 1.0)


def _safe_level(show_state: ShowState) -> float:
    """0 or 1: what the safe look is multiplied with. Blackout darkens it; panic shows it all the same."""
    return 0.0 if show_state.blackout and not show_state.panic else 1.0


def _safe_look(config: SafeConfig, patch: Patch) -> Values:
    """Slots (S,) of the safe look: defaults, everything dark but the dimmers of those that shine in it."""
    values = patch.defaults.copy()
    values[patch.dims] = 0.0
    colours = patch.select(config.fixtures, "colour")
    values[colours] = mixed(config.colour)[patch.components[colours]]
    dimmers = patch.select(config.fixtures, DIMMER)
    values[dimmers[patch.dims[dimmers]]] = config.dimmer
    return values
