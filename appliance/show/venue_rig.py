"""The rig as it hangs in a venue: a show's lights with what box.yaml changes, and what it has no wire for."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.show.box import BoxConfig
from appliance.show.config_error import Problem, did_you_mean
from appliance.show.lights import FixtureConfig, LightsConfig, channel_count, overlaps
from appliance.show.show import Show, ShowConfig
from appliance.show.venue_lights import UNIVERSE_CHANNELS, VenueLightsConfig


def unwired(show: ShowConfig, box: BoxConfig) -> list[str]:
    """A sentence for each universe that the show's fixtures are on and the box file has no wire for; one for
    wires that no fixture of the show is on."""
    wired = {wire.universe for wire in box.outputs.dmx}
    fixtures = at_venue(show.lights, box.lights).fixtures
    if wired and not fixtures:
        return [
            "The box file has wires for lights, but this show has no fixtures, so all lamps stay dark. Add "
            "them under lights: in its show.yaml (docs/lights.md)."
        ]
    return [
        f"Universe {universe} has no wire, so these stay dark: {_names(fixtures, universe)}. "
        f"Add {{universe: {universe}, wire: artnet}} (or another wire) under outputs: dmx: in the box file."
        for universe in sorted({fixture.universe for fixture in fixtures} - wired)
    ]


def misplaced(show: Show, box: BoxConfig) -> list[Problem]:
    """Faults of the box file's changes to the rig: fixtures that the show does not have, channels that are
    used twice or are beyond the end of a universe.
    """
    names = [fixture.name for fixture in show.config.lights.fixtures]
    changed = [place.fixture for place in box.lights.places]

    def problem(fixture: str, message: str, cure: str) -> Problem:
        number = (changed.index(fixture),) if fixture in changed else ()
        return box.file.problem(("lights", "places", *number), message, cure)

    problems = [
        problem(name, f"The show has no fixture '{name}'.", did_you_mean(name, names))
        for name in changed
        if name not in names
    ]
    fixtures = at_venue(show.config.lights, box.lights).fixtures
    for place, message, cure in overlaps(fixtures, show.directory):
        problems.append(problem(fixtures[place].name, message, cure))
    for fixture in fixtures:
        end = fixture.address + channel_count(fixture, show.directory) - 1
        if end > UNIVERSE_CHANNELS:
            message = f"'{fixture.name}' would end on channel {end}; a universe has {UNIVERSE_CHANNELS}."
            problems.append(problem(fixture.name, message, "Write a lower address, or another universe."))
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
