"""A slot: one attribute of one fixture, and its channels."""

from __future__ import annotations

from dataclasses import dataclass

from appliance.show.fixture_profile import LAMPS, PAN, TILT, AttributeConfig, base
from appliance.show.lights import FixtureConfig


@dataclass(frozen=True)
class Slot:
    """One attribute of one fixture. channels: its bytes from coarse to fine, counted over all universes."""

    fixture: FixtureConfig
    name: str
    config: AttributeConfig
    component: int  # which colour component it shows (colour.COMPONENTS); -1: none
    channels: tuple[int, ...]  # empty: a missing dimmer, replaced by scaling the colours

    @property
    def base(self) -> str:
        """'red' for 'red 2'."""
        return base(self.name)

    @property
    def is_lamp(self) -> bool:
        """Whether light comes from it: one colour of several."""
        return self.component >= 0 or self.base in LAMPS

    @property
    def is_inverted(self) -> bool:
        """Whether its channel runs the other way round, by profile or by patch."""
        turned = {PAN: self.fixture.invert_pan, TILT: self.fixture.invert_tilt}
        return self.config.invert != turned.get(self.base, False)
