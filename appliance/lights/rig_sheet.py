"""`bunraku lights show`: the patch as a table, and a picture of the rig in one moment of the dance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from appliance.box.show_state import ShowState
from appliance.lights.patch import Patch
from appliance.lights.plan import draw_plan
from appliance.lights.rig import Rig
from appliance.lights.run import rig_problems, say
from appliance.outputs.frame_reader import SeenFrame
from appliance.pictures.filmstrip import MissingPicturesError
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.show.box import BoxConfig, load_box
from appliance.show.bundle import default_show_path
from appliance.show.config_error import ConfigError, Problem, did_you_mean
from appliance.show.lights import FixtureConfig, LightsConfig, channel_count
from appliance.show.show import Show, load_show
from appliance.show.venue_rig import at_venue, unwired

_PASS_S = 0.02
_SETTLING_PASSES = 250  # five seconds: every head has arrived


def print_rig(
    directory: Path | None, box_file: Path | None, out: Path, mapping: str | None, at_s: float
) -> None:
    """Print the table and draw the picture. Raises ConfigError for a rig that cannot hang like this."""
    show, box = load_show(directory or default_show_path()), load_box(box_file)
    problems = rig_problems(show, box)
    names = [one.name for one in show.config.lights.mappings]
    if mapping is not None and mapping not in names:
        line = show.file.line(("lights", "mappings"))
        problems.append(
            Problem(show.file.path, line, f"There is no mapping '{mapping}'.", did_you_mean(mapping, names))
        )
    if problems:
        raise ConfigError(problems)
    config = at_venue(show.config.lights, box.lights)
    Console().print(_table(config, show, box))
    for sentence in unwired(show, box):
        say(sentence)
    try:
        say(f"The rig, from above and from the audience: {_draw(config, show, out, mapping or '', at_s)}")
    except MissingPicturesError as error:
        say(str(error))


def _table(config: LightsConfig, show: Show, box: BoxConfig) -> Table:
    table = Table(title=f"{show.config.name}: {len(config.fixtures)} fixtures", title_justify="left")
    for heading in ("fixture", "profile", "universe", "channels", "place x, y, z (m)", "pose"):
        table.add_column(heading, overflow="fold")
    for fixture in sorted(config.fixtures, key=lambda one: (one.universe, one.address)):
        table.add_row(*_row(fixture, show, box))
    return table


def _row(fixture: FixtureConfig, show: Show, box: BoxConfig) -> tuple[str, ...]:
    wires = [wire.wire for wire in box.outputs.dmx if wire.universe == fixture.universe]
    mode = f" ({fixture.mode})" if fixture.mode else ""
    last = fixture.address + channel_count(fixture, show.directory) - 1
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


def _draw(config: LightsConfig, show: Show, out: Path, mapping: str, at_s: float) -> Path:
    phrase = read_bvh(show.phrase)
    place = min(round(at_s * phrase.fps), len(phrase) - 1)
    frame = _frame(phrase, place)
    patch = Patch(config.fixtures, show.directory)
    rig = Rig(config, patch, show.skeleton)
    rig.safety = 0.0
    for number in range(_SETTLING_PASSES):
        rig.render(frame, 1, ShowState(lights=mapping, lights_before=mapping), number * _PASS_S)
    named = mapping or next((one.name for one in config.mappings), "none")
    scene = f"{place / phrase.fps:.1f} s into the phrase, mapping {named}"
    dancer = frame.positions.astype(float)
    return draw_plan(out, patch, show.skeleton, dancer, phrase.roots, show.config.name, scene)


def _frame(phrase: Recording, place: int) -> SeenFrame:
    """One instant of the phrase, as the stage would show it."""
    pose = phrase.poses[place]
    positions, world = phrase.skeleton.forward_kinematics(pose, phrase.roots[place])
    free = np.zeros(len(pose))
    small = [np.asarray(part, np.float32) for part in (pose, world, positions, phrase.roots[place], free)]
    return SeenFrame(0, _PASS_S * _SETTLING_PASSES, 0.0, False, -1, 0.0, *small)
