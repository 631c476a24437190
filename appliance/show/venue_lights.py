"""The rig in a venue: where its fixtures listen and hang, and how often they are sent to."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from appliance.show.section import Section, key

MAX_FIXTURES = 2048
UNIVERSE_CHANNELS = 512
Universe = Annotated[int, Field(ge=0, le=63999)]
Address = Annotated[int, Field(ge=1, le=UNIVERSE_CHANNELS)]
_Metre = Annotated[float, Field(ge=-1000, le=1000)]  # a stadium has 300
_Degree = Annotated[float, Field(ge=-360, le=360)]
Metres = Annotated[tuple[_Metre, _Metre, _Metre], Field(strict=False)]
Degrees = Annotated[tuple[_Degree, _Degree, _Degree], Field(strict=False)]
Pose = Literal["hanging", "standing"]


class VenuePlaceConfig(Section):
    """Changes to one fixture in this venue; keys left out stay as in the show."""

    fixture: str = key("Its name in the show.", length=(1, None))
    universe: Universe | None = key("Its universe here.", None)
    address: Address | None = key("Its first channel here.", None)
    place: Metres | None = key("Where it is here, metres (x, y, z).", None)
    pose: Pose | None = key("Hanging or standing here.", None)
    turn: Degrees | None = key("How it is turned here: yaw, pitch, roll in degrees.", None)


class VenueLightsConfig(Section):
    """The rig as it hangs in this venue."""

    rate_hz: float = key(
        "How often lights are computed; a full universe takes 22.7 ms.", 40.0, within=(1, 44)
    )
    places: list[VenuePlaceConfig] = key("Fixtures that differ from the show.", [], length=(0, MAX_FIXTURES))
