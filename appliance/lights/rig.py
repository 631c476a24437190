"""The rig: from the newest frame and the show state to the levels of all universes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.box.pace import Pace
from appliance.levers.show_state import ShowState
from appliance.levers.table import LIGHTS
from appliance.lights.colour import mixed
from appliance.lights.dance import Dances
from appliance.lights.head import LONGEST_STEP_S
from appliance.lights.mapping import Mapping, MappingOutput, faded, mappings_of
from appliance.lights.patch import Patch, Values
from appliance.lights.usual_mapping import with_usual_mapping
from appliance.outputs.joint_frame import JointFrame
from appliance.pose.skeleton import Skeleton
from appliance.show.fixture_profile import DIMMER
from appliance.show.lights import LightsConfig, SafeConfig

SAFE_FADE_S = 1.0  # into the safe look and back; panic is at once
LEAVING_FADE_S = 0.7
USUAL_RATE_HZ = 40.0
LOST_S = 1.0  # without a fresh frame for this long the stage counts as lost
MOST_LAYERS = 4  # mappings that fade into each other when cues come faster than fades end


class Rig:
    """Fixtures, mappings and the safe look. Starts in the safe look and fades in with the first frame.

    rate_hz: the nominal rate of passes. A pass that comes much later was delayed, usually with the whole
    machine: it advances by LONGEST_STEP_S alone, and no more than that counts against the stage.
    """

    def __init__(
        self,
        config: LightsConfig,
        patch: Patch,
        skeleton: Skeleton,
        rate_hz: float = USUAL_RATE_HZ,
        puppets: Sequence[str] = ("",),
        led: str = "",
        hands: Sequence[tuple[str, str]] = (),
    ) -> None:
        """puppets: their names; led: the one that cues lead; hands: puppet and joint of each, by rows."""
        self.patch = patch
        self.dances = Dances(skeleton, puppets, led, hands)
        self.safety = 1.0  # 0: only the dance; 1: only the safe look
        self._safe, self._homes = _safe_look(config.safe, patch), config.safe.heads == "home"
        self.values: Values = patch.dimmed(self._safe, 1.0)  # (S,) what the last pass showed
        self._is_dark = config.safe.dimmer == 0.0
        self._mappings = mappings_of(with_usual_mapping(config, patch, skeleton).mappings, patch)
        self._layers: list[_Layer] = []
        self._called: tuple[str, float] | None = None
        self._unseen_s = np.inf  # age of the newest frame, without delays of this process
        self._pace = Pace(LONGEST_STEP_S, rate_hz)
        self._leaving = False

    def fade_out(self) -> None:
        """Fade to the safe look from now on, whatever dances."""
        self._leaving = True

    @property
    def is_lost(self) -> bool:
        """Whether no frame came from the stage for LOST_S."""
        return self._unseen_s > LOST_S

    def render(
        self, frame: JointFrame | None, generation: int, show_state: ShowState, now: float
    ) -> dict[int, bytes]:
        """512 levels for each universe at `now` (monotonic seconds); `generation`: the stage's."""
        seconds = self._pace.step_s(now)
        self._unseen_s += seconds
        if frame is not None:
            self.dances.take_frame(frame, generation, now)
            self._unseen_s = min(self._unseen_s, now - frame.frame_time)
        self._update_safety(show_state, now, seconds)
        output = self._blend_mappings(show_state, now, seconds)
        safety = self.safety
        danced = self.patch.dimmed(output.values, show_state.level(now)) if safety < 1.0 else output.values
        safe = self.patch.dimmed(self._safe, _safe_level(show_state))
        self.values = danced + (safe - danced) * np.where(self.patch.snaps, float(safety >= 0.5), safety)
        self._turn_heads(output, seconds)
        return self.patch.encode(self.values)

    def last_levels(self, show_state: ShowState) -> dict[int, bytes]:
        """The last levels on the wires: the safe look if it is lit, else zeros.

        Blackout darkens it, as in each pass. Heads stay where they point: at zero they would swing to the end
        of their range.
        """
        heads = self.patch.heads
        is_dark = self._is_dark or not _safe_level(show_state)
        values = self.patch.rest() if is_dark else self.patch.dimmed(self._safe, 1.0)
        values[heads.axes.slots] = heads.axes.shares(heads.angles)
        return self.patch.encode(values)

    def _update_safety(self, show_state: ShowState, now: float, seconds: float) -> None:
        """Update how far the safe look is in: at once on panic, else by a fade."""
        if show_state.panic:
            self.safety = 1.0
        elif self._leaving:
            self.safety = min(self.safety + seconds / LEAVING_FADE_S, 1.0)
        elif self.is_lost or show_state.is_safe(now):
            self.safety = min(self.safety + seconds / SAFE_FADE_S, 1.0)
        else:
            self.safety = max(self.safety - seconds / SAFE_FADE_S, 0.0)

    def _turn_heads(self, output: MappingOutput, seconds: float) -> None:
        """Move the heads: towards the dance, or in the safe look hold or go home."""
        heads = self.patch.heads
        wanted, aimed = heads.angles, output.aimed
        if self.safety < 1.0:
            wanted = np.where(output.steered, heads.axes.angles(output.values), heads.angles)
        else:
            aimed = np.zeros_like(aimed)
            wanted = heads.axes.angles(self._safe) if self._homes else heads.angles
        heads.follow(wanted, output.aims, aimed, seconds)
        self.values[heads.axes.slots] = heads.axes.shares(heads.angles)

    def _blend_mappings(self, show_state: ShowState, now: float, seconds: float) -> MappingOutput:
        """The output of the mapping in force, faded in over those before it."""
        self._call(show_state)
        mappings = {layer.mapping for layer in self._layers}  # each once, even if it fades out and in again
        wanted = {mapping: mapping.evaluate(self.dances, seconds) for mapping in mappings}
        output = wanted[self._layers[0].mapping]
        for layer in self._layers[1:]:
            output = faded(output, wanted[layer.mapping], layer.part(now), self.patch.snaps)
        done = [place for place, layer in enumerate(self._layers) if layer.part(now) >= 1.0]
        self._layers = self._layers[done[-1] :]
        return output

    def _call(self, show_state: ShowState) -> None:
        """Lay the mapping that show control called over those that still fade."""
        lights = show_state[LIGHTS]
        called = (lights.value, lights.since)
        if called == self._called:
            return
        before, self._called = self._called, called
        if before is None:
            self._layers = [_Layer(self._mapping(lights.before), -np.inf, 0.0)]
        mapping = self._mapping(lights.value)
        if mapping is self._layers[-1].mapping:
            return
        mapping.restart()
        self._layers.append(_Layer(mapping, lights.since, lights.seconds))
        self._layers = self._layers[-MOST_LAYERS:]

    def _mapping(self, name: str) -> Mapping:
        return self._mappings.get(name) or next(iter(self._mappings.values()))


class _Layer:
    """A mapping that fades in over those below."""

    def __init__(self, mapping: Mapping, since: float, fade_s: float) -> None:
        self.mapping, self._since, self._fade_s = mapping, since, fade_s

    def part(self, now: float) -> float:
        """How far it is in, 0..1."""
        if self._fade_s <= 0.0:
            return 1.0
        return min(max((now - self._since) / self._fade_s, 0.0), 1.0)


def _safe_level(show_state: ShowState) -> float:
    """0 or 1, the factor of the safe look: blackout darkens it, panic overrides that."""
    return 0.0 if show_state.blackout and not show_state.panic else 1.0


def _safe_look(config: SafeConfig, patch: Patch) -> Values:
    """Slots (S,) of the safe look: defaults, and all dimmers dark except those of its fixtures."""
    values = patch.defaults.copy()
    values[patch.dims] = 0.0
    colours = patch.select(config.fixtures, "colour")
    values[colours] = mixed(config.colour)[patch.components[colours]]
    dimmers = patch.select(config.fixtures, DIMMER)
    values[dimmers[patch.dims[dimmers]]] = config.dimmer
    return values
