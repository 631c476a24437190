"""What box.yaml changes of a show's lights: where fixtures hang in this venue, how often they are told."""

from __future__ import annotations

from pydantic import Field

from appliance.show.light_rules import Metres
from appliance.show.lights import (
    MAX_FIXTURES,
    Address,
    Pose,
    Universe,
)
from appliance.show.section import Section


class VenuePlaceConfig(Section):
    """What is different about one fixture in this venue; what is left out stays as in the show."""

    fixture: str = Field(min_length=1, description="Its name in the show.")
    universe: Universe | None = Field(default=None, description="Its universe here.")
    address: Address | None = Field(default=None, description="Its first channel here.")
    place: Metres | None = Field(default=None, description="Where it is here, metres (x, y, z).")
    pose: Pose | None = Field(default=None, description="Hanging or standing here.")
    turn: Metres | None = Field(
        default=None, description="How it is turned here: yaw, pitch, roll in degrees."
    )


class VenueLightsConfig(Section):
    """The rig as it hangs in this venue."""

    rate_hz: float = Field(
        default=40.0, ge=1, le=44, description="How often lights are reckoned; a full universe takes 22.7 ms."
    )
    places: list[VenuePlaceConfig] = Field(
        default_factory=list, max_length=MAX_FIXTURES, description="Fixtures that differ from the show."
    )
