"""The rig as it hangs in a venue: what box.yaml changes of a show's lights, and what it has no wire for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field

from appliance.show.config_error import Problem, did_you_mean
from appliance.show.light_rules import Metres
from appliance.show.lights import (
    MAX_FIXTURES,
    UNIVERSE_CHANNELS,
    Address,
    FixtureConfig,
    LightsConfig,
    Pose,
    Universe,
    channel_count,
    overlaps,
)
from appliance.show.section import Section
from appliance.show.yaml_file import YamlFile, read_yaml

if TYPE_CHECKING:
    from appliance.show.box import BoxConfig
    from appliance.show.show import Show


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


def unwired(show: Show, box: BoxConfig) -> list[str]:
    """A sentence for each universe that the show's fixtures are on and the box file has no wire for."""
    wired = {wire.universe for wire in box.outputs.dmx}
    fixtures = at_venue(show.config.lights, box.lights).fixtures
    return [
        f"Universe {universe} has no wire, so these stay dark: {_names(fixtures, universe)}. "
        f"Add {{universe: {universe}, wire: artnet}} (or another wire) under outputs: dmx: in the box file."
        for universe in sorted({fixture.universe for fixture in fixtures} - wired)
    ]


def misplaced(show: Show, box: BoxConfig, box_file: Path | None) -> list[Problem]:
    """What is wrong with the box file's changes to the rig, each with its line: fixtures that the show has
    not, channels that are used twice or that a universe has not.
    """
    file = YamlFile(Path("box.yaml")) if box_file is None else read_yaml(box_file)
    names = [fixture.name for fixture in show.config.lights.fixtures]
    changed = [place.fixture for place in box.lights.places]

    def problem(fixture: str, words: str, cure: str) -> Problem:
        number = (changed.index(fixture),) if fixture in changed else ()
        return Problem(file.path, file.line(("lights", "places", *number)), words, cure)

    problems = [
        problem(name, f"The show has no fixture '{name}'.", did_you_mean(name, names))
        for name in changed
        if name not in names
    ]
    fixtures = at_venue(show.config.lights, box.lights).fixtures
    for place, words, cure in overlaps(fixtures, show.directory):
        problems.append(problem(fixtures[place].name, words, cure))
    for fixture in fixtures:
        end = fixture.address + channel_count(fixture, show.directory) - 1
        if end > UNIVERSE_CHANNELS:
            words = f"'{fixture.name}' would end on channel {end}; a universe has {UNIVERSE_CHANNELS}."
            problems.append(problem(fixture.name, words, "Write a lower address, or another universe."))
    return problems


def at_venue(lights: LightsConfig, venue: VenueLightsConfig) -> LightsConfig:
    """The rig with the venue's changes."""
    changes = {
        place.fixture: {key: value for key, value in place if key != "fixture" and value is not None}
        for place in venue.places
    }
    fixtures = [fixture.model_copy(update=changes.get(fixture.name, {})) for fixture in lights.fixtures]
    return lights.model_copy(update={"fixtures": fixtures})


def _names(fixtures: Sequence[FixtureConfig], universe: int) -> str:
    return ", ".join(fixture.name for fixture in fixtures if fixture.universe == universe)
