"""`bunraku lights show`: the patch as a table, and a picture of the rig in one moment of the dance."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from appliance.lights.audience import dazzling
from appliance.lights.beams import beams_of
from appliance.lights.patch import Patch
from appliance.lights.phrase_run import passes
from appliance.lights.plan import draw_plan
from appliance.lights.run import rig_problems, say
from appliance.lights.unknown_name import UnknownNameError
from appliance.lights.usual_mapping import with_usual_mapping
from appliance.pictures.filmstrip import MissingPicturesError
from appliance.pose.bvh import read_bvh
from appliance.pose.counted import counted
from appliance.pose.recording import Recording
from appliance.show.box import BoxConfig, load_box
from appliance.show.bundle import default_show_path
from appliance.show.config_error import ConfigError, did_you_mean
from appliance.show.lights import FixtureConfig, LightsConfig, channel_count
from appliance.show.show import Show, load_show
from appliance.show.venue_rig import at_venue, unwired

_BEFORE_S = 5.0  # the dance before the moment that is drawn: dimmers that follow speed are lit by it


def print_rig(
    directory: Path | None, box_file: Path | None, out: Path, mapping: str | None, at_s: float
) -> None:
    """Print the table and the warnings, and draw the picture.

    Raises ConfigError for a rig that cannot hang like this, UnknownNameError for an unknown mapping.
    """
    show, box = load_show(directory or default_show_path()), load_box(box_file)
    problems = rig_problems(show, box)
    names = [one.name for one in show.config.lights.mappings]
    if problems:
        raise ConfigError(problems)
    if mapping is not None and mapping not in names:
        message = f"The show has no mapping '{mapping}'. {did_you_mean(mapping, names)}"
        raise UnknownNameError("--mapping", message)
    config = at_venue(show.config.lights, box.lights)
    patch = Patch(config.fixtures, show.directory)
    config = with_usual_mapping(config, patch, show.skeleton)
    Console().print(_table(config, show, box))
    for sentence in unwired(show.config, box):
        say(sentence)
    phrase = read_bvh(show.phrase)
    for sentence in dazzling(config, patch, phrase):
        say(sentence)
    try:
        drawn = _draw(config, patch, show, phrase, out, mapping or "", at_s)
        say(f"The rig, from above and from the audience: {drawn}")
    except MissingPicturesError as error:
        say(str(error))


def _table(config: LightsConfig, show: Show, box: BoxConfig) -> Table:
    table = Table(
        title=f"{show.config.name}: {counted(len(config.fixtures), 'fixture')}", title_justify="left"
    )
    for heading in ("fixture", "profile", "universe", "channels", "place x, y, z (m)", "pose"):
        table.add_column(heading, overflow="fold")
    for fixture in sorted(config.fixtures, key=lambda one: (one.universe, one.address)):
        table.add_row(*_row(fixture, show.directory, box))
    return table


def _row(fixture: FixtureConfig, directory: Path, box: BoxConfig) -> tuple[str, ...]:
    wires = [wire.wire for wire in box.outputs.dmx if wire.universe == fixture.universe]
    mode = f" ({fixture.mode})" if fixture.mode else ""
    last = fixture.address + channel_count(fixture, directory) - 1
    turned = ", turned " + _numbers(fixture.turn) if any(fixture.turn) else ""
    return (
        fixture.name,
        fixture.profile + mode,
        f"{fixture.universe} ({', '.join(wires) or 'no wire'})",
        f"{fixture.address} to {last}",
        _numbers(fixture.place),
        fixture.pose + turned,
    )


def _numbers(values: tuple[float, float, float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _draw(
    config: LightsConfig, patch: Patch, show: Show, phrase: Recording, out: Path, mapping: str, at_s: float
) -> Path:
    place = min(round(at_s * phrase.fps), len(phrase) - 1)
    start = max(place - round(_BEFORE_S * phrase.fps), 0)
    *_, moment = passes(config, patch, phrase, mapping, start, place + 1)
    named = mapping or next((one.name for one in config.mappings), "none")
    scene = f"{moment.second:.1f} s into the phrase, mapping {named}"
    beams = beams_of(patch, moment.values)
    return draw_plan(out, beams, show.skeleton, moment.dancer, phrase.roots, show.config.name, scene)
