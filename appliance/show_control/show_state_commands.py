"""What each command declares: functions from one show state to the next."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from appliance.box.show_state import MOTION, ShowState
from appliance.outputs.shared_frame import Facts
from appliance.show.config_error import did_you_mean
from appliance.show.sources import MADE, NO_CARD, PARAMETERS, PATH, POINTS
from appliance.show_control.command import Command
from appliance.show_control.names_of_show import danced, held, joint_name, known, next_cue

STOP_FADE_S = 2.0
GO_FADE_S = 1.0
LOOK_FADE_S = 2.0  # of looks, cards, camera and lights, where a command gives none
PHRASE_FADE_S = 2.0
STAND = ("angle_deg", "elevation_deg", "figure")  # what /camera sets
MOST_AGAIN = 1000

SPRINGS_KNOBS = ("wind", "gravity", "stiffness", "storm", "feedback")  # they last until the next setting

SHOWS_RATE: dict[str, tuple[str, tuple[float, ...]]] = {"rate": ("", ())}

Declared = tuple[ShowState, str]  # the next show state, and a sentence
Declaration = Callable[[ShowState, Command, "Facts | None", float], Declared]


def _go(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    dark = show_state.panic or not show_state.going
    if not show_state.going or show_state.dance.get("rate", (0, "", ()))[2] == (0.0,):
        show_state = show_state.with_dance(now, SHOWS_RATE)
    if show_state.panic:
        show_state = replace(show_state, panic=False, going=True, going_since=now, going_fade_s=GO_FADE_S)
    elif not show_state.going:
        show_state = show_state.with_going(True, now, GO_FADE_S)
    if show_state.blackout:
        return show_state, "The show goes on, in the dark: /blackout 0 brings picture and lights back."
    return show_state, "The show goes on: picture and lights come back." if dark else "The show goes on."


def _stop(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    fade_s = command.values[0] if command.values else STOP_FADE_S
    if not show_state.going and show_state.going_level(now) <= 0.0:
        return show_state, "The show stands still already. /go lets it go on."
    if not show_state.going and fade_s == 0.0:  # a button let go: the fade of its press is not to be cut
        return show_state, "The show stops already, and its fade runs on. /go lets it go on."
    words = f"Picture and lights fade out over {fade_s:g} s, then the phrase stands still. /go lets it go on."
    return show_state.with_going(False, now, fade_s), words


def _panic(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    words = "The picture is black, and the lights show their safe look. /go lifts it."
    return replace(show_state, panic=True), words


def _blackout(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    if command.values[0]:
        return replace(show_state, blackout=True), "Dark; the dance goes on. /blackout 0 lifts it."
    return replace(show_state, blackout=False), "Picture and lights are as bright as master says."


def _master(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    master, *fade = command.values
    show_state = show_state.with_master(master, now, fade[0] if fade else 0.0)
    return show_state, f"Master goes to {100 * master:.0f} %."


def _strings(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    strings, *fade = command.values
    show_state = show_state.with_strings(strings, now, fade[0] if fade else 0.0)
    return show_state, f"The strings go to {100 * strings:.0f} %."


def _look(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    name = known("look", command.text, facts.looks if facts else None)
    fade_s = command.values[0] if command.values else LOOK_FADE_S
    return show_state.with_look(name, now, fade_s), f"The look {name} comes over {fade_s:g} s."


def _card(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    fade_s = command.values[0] if command.values else LOOK_FADE_S
    if command.text == NO_CARD:
        return show_state.with_card("", now, fade_s), f"The card goes over {fade_s:g} s."
    name = known("card", command.text, facts.cards if facts else None)
    return show_state.with_card(name, now, fade_s), f"The card {name} comes over {fade_s:g} s."


def _camera(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    given = 0 if command.address == "/camera/look" else len(STAND)
    fade_s = command.values[given] if command.values[given:] else LOOK_FADE_S
    camera = dict(zip(STAND[:given], command.values, strict=False))
    return show_state.with_camera(camera, now, fade_s), f"The camera moves over {fade_s:g} s."


def _lights(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    name = known("set of light mappings", command.text, facts.lights if facts else None)
    fade_s = command.values[0] if command.values else LOOK_FADE_S
    return show_state.with_lights(name, now, fade_s), f"The lights {name} come over {fade_s:g} s."


def _cue(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    facts = danced(facts)
    cues = {str(cue["name"]): cue for cue in facts.cues}
    name = known("cue", command.text, [*cues]) if command.text else next_cue(show_state.cue, [*cues])
    cue, fade_s = cues[name], float(cues[name]["fade_s"])
    parts: dict[str, tuple[str, tuple[float, ...]]] = {"cue": (name, ())}
    if cue.get("phrase") is not None:
        parts["phrase"] = cue["phrase"], (fade_s,)
    if cue.get("hands") is not None:
        parts |= {f"hand {joint}": (joint, (float(joint in cue["hands"]),)) for joint in held(facts)}
    if cue.get("springs") is not None:
        show_state, parts["springs"] = _without_knobs(show_state), (cue["springs"], (fade_s,))
    for source, changes in (cue.get("motion") or {}).items():
        for key, value in changes.items():
            values = tuple(map(float, value)) if key == POINTS else (float(value), fade_s)
            parts[f"{MOTION}{source} {key}"] = "", values
    if cue.get("iterations") is not None:
        parts["iterations"] = "", (*map(float, cue["iterations"]), fade_s)
    if cue.get("liveliness") is not None:
        parts["liveliness"] = "", (float(cue["liveliness"]), fade_s)
    if cue.get("seed") is not None:
        parts["seed"] = "", (float(cue["seed"]),)
    return in_cue(show_state, cue, PARTS, now).with_dance(now, parts), f"Cue {name}."


def _phrase(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    name = known("phrase", command.text, (*danced(facts).phrases, *command.kept))
    return show_state.with_dance(now, {"phrase": (name, command.values or (PHRASE_FADE_S,))}), ""


def _motion(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    _, _, source, name = command.address.split("/")
    known("source of motion", source, danced(facts).phrases)
    value, *fade_s = command.values
    words = f"The {name} of {source} goes to {value:g}{f' over {fade_s[0]:g} s' if fade_s else ''}."
    return show_state.with_dance(now, {f"{MOTION}{source} {name}": ("", command.values)}), words


def _points(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    known("source of motion", PATH, danced(facts).phrases)
    if len(command.values) % 2:
        raise ValueError("/motion/path takes x and y of each point, and the last one has no y.")
    points = len(command.values) // 2
    words = {0: "The path is the phrase's own again.", 1: "The path stays at this point of the map."}
    said = words.get(points, f"The path is a line of {points} points, there and back.")
    return show_state.with_dance(now, {f"{MOTION}{PATH} {POINTS}": ("", command.values)}), said


def _again(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    if not any(source in danced(facts).phrases for source in MADE):
        raise ValueError("This show has no source that is made ahead: show.yaml names them under motion.")
    before = show_state.dance.get(f"{MOTION}again", (0, "", (0.0,)))[2][0]
    return show_state.with_dance(
        now, {f"{MOTION}again": ("", ((before + 1) % MOST_AGAIN,))}
    ), "Once more, anew."


def _iterations(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    danced(facts)
    return show_state.with_dance(now, {"iterations": ("", command.values)}), ""


def _liveliness(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    danced(facts)
    words = f"The liveliness goes to {100 * command.values[0]:.0f} %."
    return show_state.with_dance(now, {"liveliness": ("", command.values)}), words


def _seed(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    danced(facts)
    words = f"The answer goes over to the seed {command.values[0]:.0f}."
    return show_state.with_dance(now, {"seed": ("", command.values)}), words


def _springs(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    name = known("setting of springs", command.text, danced(facts).springs)
    parts = {"springs": (name, command.values)}
    return _without_knobs(show_state).with_dance(now, parts), f"The springs are {name}."


def _knob(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    if not danced(facts).springs:
        raise ValueError("No hand of this show is springs. Add {springs: loose, joint: ...} to its hands.")
    part = command.address.removeprefix("/springs/")
    return show_state.with_dance(now, {part: ("", command.values)}), ""


def _without_knobs(show_state: ShowState) -> ShowState:
    """Another setting of the springs brings its own wind, gravity and feedback."""
    dance = {name: part for name, part in show_state.dance.items() if name not in SPRINGS_KNOBS}
    return replace(show_state, dance=dance)


def _hold(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    joint, joints = joint_name(command.text, facts), held(danced(facts))
    if joint not in joints:
        cure = did_you_mean(joint, joints) if joints else "Give it some under `hands` in its show.yaml."
        raise ValueError(f"No hand of this show holds '{joint}'. {cure}")
    words = f"The hand of {joint} {'holds' if command.values[0] else 'lets go'}."
    return show_state.with_dance(now, {f"hand {joint}": (joint, command.values)}), words


def _rate(show_state: ShowState, command: Command, facts: Facts | None, now: float) -> Declared:
    danced(facts)
    rate = (0.0,) if command.address == "/player/stop" else command.values
    return show_state.with_dance(now, {"rate": ("", rate)}), ""


DECLARATIONS: dict[str, Declaration] = {
    "/go": _go,
    "/stop": _stop,
    "/panic": _panic,
    "/blackout": _blackout,
    "/master": _master,
    "/look": _look,
    "/card": _card,
    "/camera": _camera,
    "/camera/look": _camera,
    "/lights": _lights,
    "/cue": _cue,
    "/phrase": _phrase,
    "/iterations": _iterations,
    "/liveliness": _liveliness,
    "/seed": _seed,
    "/hold": _hold,
    "/springs": _springs,
    "/strings": _strings,
    **{f"/springs/{name}": _knob for name in SPRINGS_KNOBS},
    "/motion/path": _points,
    "/motion/again": _again,
    **{f"/motion/{source}/{name}": _motion for source, names in PARAMETERS.items() for name in names},
    "/player/start": _rate,
    "/player/stop": _rate,
    "/player/rate": _rate,
}

_LET_GO = {
    "/go": "/go 0 is a button let go: nothing changes.",
    "/panic": "/panic 0 is a button let go: nothing changes. /go lifts a panic.",
}


def let_go(command: Command) -> str:
    """What to answer when a tablet's button, which sent 1 when it was pressed, sends 0; else empty."""
    return _LET_GO.get(command.address, "") if command.values == (0.0,) else ""


PARTS = ("look", "card", "camera", "lights", "master", "strings")  # what is seen and heard beside it


def in_cue(show_state: ShowState, cue: Mapping[str, Any], parts: Iterable[str], now: float) -> ShowState:
    """The show state in a cue, without its dance: of `parts` those that the cue names."""
    fade_s = float(cue["fade_s"])
    wanted = {part: cue[part] for part in parts if cue.get(part) is not None}
    if "look" in wanted:
        show_state = show_state.with_look(wanted["look"], now, fade_s)
    if "card" in wanted:
        card = wanted["card"] if wanted["card"] != NO_CARD else ""
        show_state = show_state.with_card(card, now, fade_s)
    if "camera" in wanted:
        camera = {key: value for key, value in wanted["camera"].items() if value is not None}
        show_state = show_state.with_camera(camera, now, fade_s)
    if "lights" in wanted:
        show_state = show_state.with_lights(wanted["lights"], now, fade_s)
    if "master" in wanted:
        show_state = show_state.with_master(float(wanted["master"]), now, fade_s)
    if "strings" in wanted:
        show_state = show_state.with_strings(float(wanted["strings"]), now, fade_s)
    return replace(show_state, cue=cue["name"])


def of_this_show(show_state: ShowState, facts: Facts | None) -> ShowState:
    """Without the dance of another show, and without names that this one does not know."""
    if facts is None:
        return show_state
    show_state = show_state.for_show(facts.show_name)
    return replace(
        show_state,
        look=show_state.look if show_state.look in facts.looks else "",
        look_before=show_state.look_before if show_state.look_before in facts.looks else "",
        card=show_state.card if show_state.card in facts.cards else "",
        card_before=show_state.card_before if show_state.card_before in facts.cards else "",
        lights=show_state.lights if show_state.lights in facts.lights else "",
        lights_before=show_state.lights_before if show_state.lights_before in facts.lights else "",
        cue=show_state.cue if show_state.cue in [cue["name"] for cue in facts.cues] else "",
    )
