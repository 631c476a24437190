"""What the commands of show control make of the house: each a function from one house to the next."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from appliance.box.show_state import House
from appliance.outputs.shared_frame import Facts
from appliance.show.config_error import did_you_mean
from appliance.show_control.command import Command

STOP_FADE_S = 2.0
GO_FADE_S = 1.0
LOOK_FADE_S = 2.0  # of looks and lights, where a command gives none

Change = Callable[[House, Command, "Facts | None", float], tuple[House, str]]


def _go(house: House, command: Command, facts: Facts | None, now: float) -> tuple[House, str]:
    dark = house.panic or not house.going
    if house.panic:
        house = replace(house, panic=False, going=True, going_since=now, going_fade_s=GO_FADE_S)
    elif not house.going:
        house = house.with_going(True, now, GO_FADE_S)
    if house.blackout:
        return house, "The show goes on, in the dark: /blackout 0 brings picture and lights back."
    return house, "The show goes on: picture and lights come back." if dark else "The show goes on."


def _stop(house: House, command: Command, facts: Facts | None, now: float) -> tuple[House, str]:
    fade_s = command.values[0] if command.values else STOP_FADE_S
    if not house.going and house.going_level(now) <= 0.0:
        return house, "The show stands still already. /go lets it go on."
    if not house.going and fade_s == 0.0:  # a button let go: the fade of its press is not to be cut
        return house, "The show stops already, and its fade runs on. /go lets it go on."
    words = f"Picture and lights fade out over {fade_s:g} s, then the phrase stands still. /go lets it go on."
    return house.with_going(False, now, fade_s), words


def _panic(house: House, command: Command, facts: Facts | None, now: float) -> tuple[House, str]:
    words = "The picture is black, and the lights show their safe look. /go lifts it."
    return replace(house, panic=True), words


def _blackout(house: House, command: Command, facts: Facts | None, now: float) -> tuple[House, str]:
    if command.values[0]:
        return replace(house, blackout=True), "Dark; the dance goes on. /blackout 0 lifts it."
    return replace(house, blackout=False), "Picture and lights are as bright as master says."


def _master(house: House, command: Command, facts: Facts | None, now: float) -> tuple[House, str]:
    master, *fade = command.values
    house = house.with_master(master, now, fade[0] if fade else 0.0)
    return house, f"Master goes to {100 * master:.0f} %."


def _look(house: House, command: Command, facts: Facts | None, now: float) -> tuple[House, str]:
    name = known("look", command.text, facts.looks if facts else None)
    fade_s = command.values[0] if command.values else LOOK_FADE_S
    return house.with_look(name, now, fade_s), f"The look {name} comes over {fade_s:g} s."


def _lights(house: House, command: Command, facts: Facts | None, now: float) -> tuple[House, str]:
    name = known("set of light mappings", command.text, facts.lights if facts else None)
    fade_s = command.values[0] if command.values else LOOK_FADE_S
    return house.with_lights(name, now, fade_s), f"The lights {name} come over {fade_s:g} s."


CHANGES: dict[str, Change] = {
    "/go": _go,
    "/stop": _stop,
    "/panic": _panic,
    "/blackout": _blackout,
    "/master": _master,
    "/look": _look,
    "/lights": _lights,
}

_LET_GO = {
    "/go": "/go 0 is a button let go: nothing changes.",
    "/panic": "/panic 0 is a button let go: nothing changes. /go lifts a panic.",
}


def let_go(command: Command) -> str:
    """What to answer when a tablet's button, which sent 1 when it was pressed, sends 0; else empty."""
    return _LET_GO.get(command.address, "") if command.values == (0.0,) else ""


PARTS = ("look", "lights", "master")  # of the house, that cues set


def in_cue(house: House, cue: Mapping[str, Any], parts: Collection[str], now: float) -> House:
    """The house in a cue that the stage has carried out; of PARTS, only `parts` and what the cue names."""
    fade_s = float(cue["fade_s"])
    wanted = {part: cue[part] for part in parts if cue.get(part) is not None}
    if "look" in wanted:
        house = house.with_look(wanted["look"], now, fade_s)
    if "lights" in wanted:
        house = house.with_lights(wanted["lights"], now, fade_s)
    if "master" in wanted:
        house = house.with_master(float(wanted["master"]), now, fade_s)
    return replace(house, cue=cue["name"])


def of_this_show(house: House, facts: Facts) -> House:
    """A house that another show has left: names that this one does not know are forgotten."""
    return replace(
        house,
        look=house.look if house.look in facts.looks else "",
        look_before=house.look_before if house.look_before in facts.looks else "",
        lights=house.lights if house.lights in facts.lights else "",
        lights_before=house.lights_before if house.lights_before in facts.lights else "",
        cue=house.cue if house.cue in [cue["name"] for cue in facts.cues] else "",
    )


def known(kind: str, name: str | int, names: Sequence[str] | None) -> str:
    """The name, if the show has it. Raises ValueError with the nearest one; `names` None: no stage so far."""
    if names is None:
        raise ValueError(
            f"No stage has danced on this box yet: whether there is a {kind} '{name}' is unknown."
        )
    if name not in names:
        cure = did_you_mean(name, names) if names else "It has none at all: show.yaml names them."
        raise ValueError(f"This show has no {kind} '{name}'. {cure}")
    return str(name)


def next_cue(house: House, facts: Facts | None) -> str:
    """The one after the cue in force, in the order of show.yaml; the first one at the beginning."""
    names = [str(cue["name"]) for cue in facts.cues] if facts else []
    if not names:
        raise ValueError("This show has no cues: show.yaml names them.")
    place = names.index(house.cue) + 1 if house.cue in names else 0
    if place == len(names):
        raise ValueError(f"{house.cue} was the last cue. Name one, like /cue {names[0]}.")
    return names[place]
