"""`bunraku lights show`: the patch as a table, and a picture of the rig in one moment of the dance."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from appliance.lights.beams import beams_of
from appliance.lights.head import Array
from appliance.lights.patch import Patch
from appliance.lights.phrase_run import passes
from appliance.lights.plan import draw_plan
from appliance.lights.run import rig_problems
from appliance.lights.unknown_name import UnknownNameError
from appliance.lights.usual_mapping import with_usual_mapping
from appliance.pictures.filmstrip import MissingPicturesError
from appliance.pose.body import Body
from appliance.pose.bvh import read_bvh
from appliance.pose.counted import counted
from appliance.pose.recording import Recording
from appliance.show.box import BoxConfig, load_box
from appliance.show.bundle import default_show_path
from appliance.show.config_error import ConfigError, did_you_mean
from appliance.show.lights import FixtureConfig, LightsConfig, channel_count
from appliance.show.show import Show, load_show
from appliance.show.venue_rig import at_venue, unwired

# Where people sit: this far in front of the foremost place of the phrase, on seats that rise no steeper.
DISTANCE_M, DEPTH_M = 2.5, 20.0
LOW_M, HIGH_M, RISE = 0.8, 2.0, 0.45  # eyes of the first row, seated to standing; metres up a metre back
DARK = 0.02  # a level that dazzles nobody
_EVERY_S = 0.1

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
        _say(sentence)
    phrase = read_bvh(show.phrase)
    for sentence in dazzling(config, patch, phrase):
        _say(sentence)
    try:
        drawn = _draw(config, patch, show, phrase, out, mapping or "", at_s)
        _say(f"The rig, from above and from the audience: {drawn}")
    except MissingPicturesError as error:
        _say(str(error))


def _say(message: str) -> None:
    """Print a line; a closed terminal is ignored."""
    with contextlib.suppress(OSError, ValueError):
        print(message, flush=True)


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
    dancer = Body(show.skeleton).cones(moment.places, moment.turns)
    return draw_plan(out, beams, dancer, phrase.roots, show.config.name, scene)


def dazzling(config: LightsConfig, patch: Patch, phrase: Recording) -> list[str]:
    """A sentence for each fixture and mapping whose light meets the audience's eyes in the phrase."""
    edge = float(phrase.roots[:, 2].max()) + DISTANCE_M
    step, sentences = max(round(_EVERY_S * phrase.fps), 1), []
    for mapping in config.mappings:
        seconds: dict[str, list[float]] = {}
        danced = 0
        for one in passes(config, patch, phrase, mapping.name, 0, len(phrase), step):
            danced += 1
            beams = [beam for beam in beams_of(patch, one.values) if beam.level > DARK]
            if not beams:
                continue
            places, ways = np.array([beam.place for beam in beams]), np.array([b.direction for b in beams])
            for at in np.flatnonzero(meets_eyes(places, ways, edge)):
                seconds.setdefault(beams[at].fixture.name, []).append(one.second)
        for name, when in seconds.items():
            share = math.ceil(100 * len(set(when)) / danced)
            sentences.append(
                f"'{name}' shines into the audience's eyes in {share} % of the phrase with the mapping "
                f"'{mapping.name}', first at {when[0]:.1f} s. Hang it elsewhere, aim it at another place, or "
                "give it pan_limits and tilt_limits."
            )
    return sentences


def meets_eyes(places: Array, directions: Array, edge: float) -> NDArray[np.bool_]:
    """Whether beams (B, 3) from places (B, 3) pass where eyes are, from z = edge metres on."""
    forwards = directions[:, 2] > 1e-6
    slope = directions[:, 1] / np.where(forwards, directions[:, 2], 1.0)  # metres up a metre towards the back
    starts = np.maximum(edge, places[:, 2])
    height = places[:, 1] + slope * (starts - places[:, 2])
    back = starts - edge
    within = (height >= LOW_M) & (height <= HIGH_M + RISE * back)
    with np.errstate(divide="ignore", invalid="ignore"):
        rises = back + (LOW_M - height) / slope  # metres behind the edge where it comes up to the eyes
        falls = (height - HIGH_M - slope * back) / (RISE - slope)  # where it comes down to them
    later = ((height < LOW_M) & (slope > 0) & (rises <= DEPTH_M)) | (
        (height > HIGH_M + RISE * back) & (slope < RISE) & (falls <= DEPTH_M)
    )
    return forwards & (within | later)
