"""The patch: all attributes of all fixtures as one array, and the channels that they map to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.lights.colour import SUBTRACTIVE, components_of, mixed
from appliance.lights.head import Heads, heads_of
from appliance.lights.slot import Slot
from appliance.show.fixture_profile import DIMMER, FINE, PAN, TILT, AttributeConfig, ModeConfig, load_profile
from appliance.show.light_rules import COLOUR
from appliance.show.lights import FixtureConfig
from appliance.show.venue_lights import UNIVERSE_CHANNELS

Values = NDArray[np.float64]
Indices = NDArray[np.intp]


class Patch:
    """Slots (S) of a rig: for each its value 0..1, its default, its channels."""

    def __init__(self, fixtures: Sequence[FixtureConfig], show: Path | None) -> None:
        self.fixtures = tuple(fixtures)
        self.universes = tuple(sorted({fixture.universe for fixture in fixtures}))
        self.slots: tuple[Slot, ...] = tuple(
            slot for fixture in fixtures for slot in self._slots_of(fixture, show)
        )
        self._own: dict[str, list[int]] = {fixture.name: [] for fixture in fixtures}
        for place, slot in enumerate(self.slots):
            self._own[slot.fixture.name].append(place)
        self.defaults: Values = np.array([self._default(slot) for slot in self.slots], float)
        self.components: Indices = np.array([slot.component for slot in self.slots], np.intp)
        self.snaps: NDArray[np.bool_] = np.array([slot.config.snap for slot in self.slots], bool)
        self.dims: NDArray[np.bool_] = np.array([self._dims(slot) for slot in self.slots], bool)
        self.scaled, self.scales = self._stand_ins()
        self.heads: Heads = heads_of(self.slots)
        self._prepare_channels()

    def select(self, names: Sequence[str], attribute: str) -> Indices:
        """Slots of an attribute on these fixtures ([]: on all); `red` also means `red 1`, `red 2`, ..."""
        found = []
        for name in names or self._own:
            own = self._own[name]
            if attribute == COLOUR:
                found += [place for place in own if self.slots[place].component >= 0]
                continue
            exact = [place for place in own if self.slots[place].name == attribute]
            found += exact or [place for place in own if self.slots[place].base == attribute]
        return np.array(found, np.intp)

    def own(self, fixture: FixtureConfig) -> Sequence[int]:
        return self._own[fixture.name]

    def dimmed(self, values: Values, level: Values | float) -> Values:
        """The values with dimmers scaled by `level` (a number or (S,)); a fixture without a dimmer scales its
        colours.
        """
        shown = np.where(self.dims, values * level, values)
        if len(self.scaled):
            light = shown[self.scaled]
            by = shown[self.scales]
            shown[self.scaled] = np.where(self._subtractive, 1.0 - (1.0 - light) * by, light * by)
        return shown

    def rest(self) -> Values:
        """Zero (S,), and full cyan, magenta, yellow on lamps without dimmer, which would shine at zero."""
        return self.dimmed(np.zeros(len(self.slots)), 0.0)

    def encode(self, values: Values) -> dict[int, bytes]:
        """512 levels for each universe: coarse and fine bytes, inverted and limited as the profiles say."""
        turned = np.where(self._inverted, 1.0 - values, values)
        raw = np.rint(self._low + np.clip(turned, 0.0, 1.0) * self._room).astype(np.int64)
        levels = np.zeros(len(self.universes) * UNIVERSE_CHANNELS, np.uint8)
        levels[self._channels] = (raw[self._channel_slots] >> self._shifts) & 0xFF
        return {
            universe: levels[place * UNIVERSE_CHANNELS : (place + 1) * UNIVERSE_CHANNELS].tobytes()
            for place, universe in enumerate(self.universes)
        }

    def _slots_of(self, fixture: FixtureConfig, show: Path | None) -> list[Slot]:
        profile = load_profile(fixture.profile, show)
        mode = profile.mode(fixture.mode)
        components = components_of(mode.attributes)
        first = self.universes.index(fixture.universe) * UNIVERSE_CHANNELS + fixture.address - 1
        slots = [
            Slot(
                fixture, name, profile.attribute(name), components.get(name, -1), _channels(mode, name, first)
            )
            for name in mode.attributes
        ]
        if any(slot.is_lamp for slot in slots) and not any(slot.base == DIMMER for slot in slots):
            slots.append(Slot(fixture, DIMMER, AttributeConfig(name=DIMMER), -1, ()))
        return slots

    def _default(self, slot: Slot) -> float:
        if slot.config.default is not None:
            return slot.config.default
        if slot.component >= 0:
            return float(mixed((1.0, 1.0, 1.0))[slot.component])
        if slot.base in (PAN, TILT):
            return 0.5
        own = [self.slots[place] for place in self._own[slot.fixture.name]]
        if slot.is_lamp:  # amber beside red, green, blue waits for a rule; warm and cold white shine
            return float(all(other.component < 0 for other in own))
        return float(slot.base == DIMMER and slot.name != DIMMER and self._has_dimmer(slot.fixture))

    def _dims(self, slot: Slot) -> bool:
        """A fixture's own dimmer dims it; those of its cells only if the fixture has none."""
        is_dimmer = slot.name == DIMMER or (slot.base == DIMMER and not self._has_dimmer(slot.fixture))
        return is_dimmer or slot.config.dims

    def _has_dimmer(self, fixture: FixtureConfig) -> bool:
        return any(self.slots[place].name == DIMMER for place in self._own[fixture.name])

    def _stand_ins(self) -> tuple[Indices, Indices]:
        """Colour slots that stand in for a missing dimmer, and the slot of that dimmer for each."""
        pairs = [
            (place, dimmer)
            for dimmer, missing in enumerate(self.slots)
            if not missing.channels
            for place in self._own[missing.fixture.name]
            if self.slots[place].is_lamp
        ]
        scaled, scales = np.array(pairs, np.intp).reshape(-1, 2).T
        self._subtractive = np.isin(self.components[scaled], SUBTRACTIVE)
        return scaled, scales

    def _prepare_channels(self) -> None:
        """Precompute the channel of each byte of each slot, for all universes."""
        slots = self.slots
        self._inverted = np.array([slot.is_inverted for slot in slots], bool)
        scale = np.array([256.0 ** max(len(slot.channels) - 1, 0) for slot in slots])
        low, high = np.array([slot.config.limits for slot in slots], float).reshape(-1, 2).T
        self._low = low * scale
        self._room = (high + 1.0) * scale - 1.0 - self._low
        bytes_of = [
            (place, channel, 8 * (len(slot.channels) - 1 - number))
            for place, slot in enumerate(slots)
            for number, channel in enumerate(slot.channels)
        ]
        table = np.array(bytes_of, np.intp).reshape(-1, 3).T
        self._channel_slots, self._channels, self._shifts = table


def _channels(mode: ModeConfig, name: str, first: int) -> tuple[int, ...]:
    """An attribute's bytes in a mode, from coarse to fine; `first` is the fixture's first channel."""
    parts = [name, *(name + fine for fine in FINE)]
    return tuple(first + mode.channels.index(part) for part in parts if part in mode.channels)
