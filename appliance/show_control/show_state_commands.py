"""Declarations: functions from one show state to the next, for each command that persists."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from appliance.levers.addresses import ADDRESSES
from appliance.levers.fade import Fade
from appliance.levers.lever import AT_ONCE, Lever
from appliance.levers.show_state import Change, ShowState
from appliance.levers.sources import MADE, POINTS
from appliance.levers.table import (
    AGAIN,
    CAMERA,
    CUE,
    GO_FADE_S,
    GOAL,
    GOING,
    HAND,
    LEVERS,
    MADE_NUMBERS,
    MOST_AGAIN,
    PATH_POINTS,
    PHRASE,
    RATE,
    STOP_FADE_S,
    hand,
)
from appliance.outputs.shared_frame import Facts
from appliance.show.config_error import did_you_mean
from appliance.show_control.command import Command
from appliance.show_control.names_of_show import danced, held, joint_name, known, next_cue

Declared = tuple[ShowState, str]  # the next show state, and a sentence
Declaration = Callable[[ShowState, Command, "Facts | None", float], Declared]


def declare(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    """Carry out a command that persists. Raises ValueError with a sentence for one that cannot be."""
    if (own := OWN.get(command.address)) is not None:
        return own(show_state, command, facts, now)
    lever = ADDRESSES[command.address].lever
    if lever is None:
        raise ValueError(f"{command.address} declares nothing.")
    value, seconds = lever.given(str(command.text), command.values)
    _require(lever, value, command, facts)
    return show_state.to(lever, value, now, seconds), lever.said(value, seconds)


def _require(lever: Lever[Any], value: Any, command: Command, facts: Facts | None) -> None:
    """Raises ValueError where the show has no such name, or nothing that the lever moves."""
    if lever.follower:
        danced(facts)
    if (need := lever.needs) is not None:
        among = getattr(danced(facts), need.among)
        if need.what != ("", ""):
            known(*need.what, among)
        elif not among:
            raise ValueError(need.cure)
    if lever.names != ("", "") and value:
        names, what = lever.names
        saved = command.saved if lever is PHRASE else ()
        known(what, value, (*getattr(facts, names), *saved) if facts else None)


def _go(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    dark = show_state.panic or not show_state.going
    if not show_state.going or show_state[RATE].value == 0.0:
        show_state = show_state.to(RATE, None, now)
    if show_state.panic:
        come_back = {**show_state.settings, GOING.name: Fade(1.0, 0.0, now, GO_FADE_S)}
        show_state = replace(show_state, panic=False, settings=come_back)
    elif not show_state.going:
        show_state = _going(show_state, 1.0, now, GO_FADE_S)
    if show_state.blackout:
        return show_state, "The show goes on, in the dark: /blackout 0 brings picture and lights back."
    return show_state, "The show goes on: picture and lights come back." if dark else "The show goes on."


def _stop(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    fade_s = command.values[0] if command.values else STOP_FADE_S
    if not show_state.going and show_state[GOING].level(now) <= 0.0:
        return show_state, "The show stands still already. /go lets it go on."
    if not show_state.going and fade_s == 0.0:  # a button let go: the fade of its press is not to be cut
        return show_state, "The show stops already, and its fade runs on. /go lets it go on."
    message = (
        f"Picture and lights fade out over {fade_s:g} s, then the phrase stands still. /go lets it go on."
    )
    return _going(show_state, 0.0, now, fade_s), message


def _going(show_state: ShowState, going: float, now: float, fade_s: float) -> ShowState:
    """Stop or go on from the brightness of this moment; `fade_s` is for the whole way."""
    return show_state.to(GOING, going, now, fade_s * abs(going - show_state[GOING].level(now)))


def _panic(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    message = "The picture is black, and the lights show their safe look. /go lifts it."
    return replace(show_state, panic=True), message


def _blackout(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    if command.values[0]:
        return replace(show_state, blackout=True), "Dark; the dance goes on. /blackout 0 lifts it."
    return replace(show_state, blackout=False), "Picture and lights are as bright as master says."


def _cue(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    facts = danced(facts)
    cues = {str(cue["name"]): cue for cue in facts.cues}
    name = known("cue", command.text, [*cues]) if command.text else next_cue(show_state.cue, [*cues])
    return show_state.changed(now, in_cue(cues[name], facts)), f"Cue {name}."


def in_cue(cue: Mapping[str, Any], facts: Facts) -> Iterator[Change[Any]]:
    fade_s = float(cue["fade_s"])
    yield Change(CUE, str(cue["name"]))
    for lever in LEVERS:
        given = cue.get(lever.cue) if lever.cue else None
        if given is None:
            continue
        if lever is HAND:
            yield from (Change(hand(joint), joint in given) for joint in held(facts))
        else:
            yield Change(lever, lever.kind.plain(given), 0.0 if lever.fade_s is AT_ONCE else fade_s)
    for source, changes in (cue.get("motion") or {}).items():
        for key, value in changes.items():
            if key == POINTS:
                yield Change(PATH_POINTS, PATH_POINTS.kind.plain(value))
            else:
                yield Change(MADE_NUMBERS[source][key], float(value), fade_s)


def _camera_of_look(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    fade_s = command.values[0] if command.values else CAMERA.fade_s or 0.0
    return show_state.to(CAMERA, {}, now, fade_s), CAMERA.said({}, fade_s)


def _points(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    _require(PATH_POINTS, (), command, facts)
    if len(command.values) % 2:
        raise ValueError("/motion/path takes x and y of each point, and the last one has no y.")
    return show_state.to(PATH_POINTS, command.values, now), PATH_POINTS.said(command.values, 0.0)


def _goal(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    _require(GOAL, (), command, facts)
    if len(command.values) == 1:
        raise ValueError("/goal takes x and z in metres, or nothing: z is missing.")
    return show_state.to(GOAL, command.values, now), GOAL.said(command.values, 0.0)


def _again(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    if not any(source in danced(facts).phrases for source in MADE):
        raise ValueError("This show has no source that is made ahead: show.yaml names them under motion.")
    times = (show_state[AGAIN].value + 1) % MOST_AGAIN
    return show_state.to(AGAIN, times, now), "Once more, anew."


def _hold(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    joint, joints = joint_name(command.text, facts), held(danced(facts))
    if joint not in joints:
        cure = did_you_mean(joint, joints) if joints else "Give it some under `hands` in its show.yaml."
        raise ValueError(f"No hand of this show holds '{joint}'. {cure}")
    lever, holds = hand(joint), bool(command.values[0])
    return show_state.to(lever, holds, now), lever.said(holds, 0.0)


def _start(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    danced(facts)
    return show_state.to(RATE, None if command.address == "/player/start" else 0.0, now), ""


OWN: dict[str, Declaration] = {
    "/go": _go,
    "/stop": _stop,
    "/panic": _panic,
    "/blackout": _blackout,
    "/cue": _cue,
    "/camera/look": _camera_of_look,
    "/hold": _hold,
    "/goal": _goal,
    "/motion/path": _points,
    "/motion/again": _again,
    "/player/start": _start,
    "/player/stop": _start,
}

_LET_GO = {
    "/go": "/go 0 is a button let go: nothing changes.",
    "/panic": "/panic 0 is a button let go: nothing changes. /go lifts a panic.",
}


def let_go(command: Command) -> str:
    """The answer to a tablet's button that was let go, which sends 0; else empty."""
    return _LET_GO.get(command.address, "") if command.values == (0.0,) else ""


def of_this_show(show_state: ShowState, facts: Facts | None) -> ShowState:
    """Without the dance of another show, and without names that this one does not know."""
    if facts is None:
        return show_state
    show_state = show_state.for_show(facts.show_name)
    settings = dict(show_state.settings)
    for lever in LEVERS:
        if lever.stays and lever.names != ("", "") and lever in show_state:
            fade, names = show_state[lever], getattr(facts, lever.names[0])
            value, before = (one if one in names else "" for one in (fade.value, fade.before))
            settings[lever.name] = replace(fade, value=value, before=before)
    if show_state.cue not in [cue["name"] for cue in facts.cues]:
        settings.pop(CUE.name, None)
    return replace(show_state, settings=settings)
