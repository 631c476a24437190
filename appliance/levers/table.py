"""The table of all levers. Addresses, cues, the page, the journal and docs/osc.md are made from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from appliance.levers import kind
from appliance.levers.form import Number
from appliance.levers.lever import AT_ONCE, Lever, Need
from appliance.levers.sources import MADE, MOST_POINTS, NO_CARD, PARAMETERS, PATH, POINTS, SEEDS

STOP_FADE_S = 2.0
GO_FADE_S = 1.0
LOOK_FADE_S = 2.0
PHRASE_FADE_S = 2.0
KNOB_S = 0.5
MOST_ITERATIONS = 64
MOST_AGAIN = 1000
MOTION = "motion"

_POINT = (Number("x", 0, 1), Number("y", 0, 1))
VELOCITY = tuple(Number(f"{axis}, m/s", -30, 30) for axis in "xyz")
STAND = {
    "angle_deg": Number("angle in degrees", -180, 180),
    "elevation_deg": Number("elevation in degrees", -3, 70),
    "figure": Number("figure", 0.1, 0.9),
}
_SPRUNG = Need(
    "springs", cure="No hand of this show is springs. Add {springs: loose, joint: ...} to its hands."
)

GOING = Lever("going", kind.number("going", 0, 1), 1.0, stays=True)
CUE = Lever("cue", kind.name("cue"), "", fade_s=AT_ONCE, follower="stage")
PHRASE = Lever(
    "phrase",
    kind.name("phrase"),
    "",
    "the puppet starts from this phrase, from the `live` dancer, from motion that is made ahead (`vary`, "
    "`granular`, `path`, `improvise`; [below](#motion-that-is-made-ahead)), or from one that was kept",
    "/phrase",
    PHRASE_FADE_S,
    cue="phrase",
    in_cue="The puppet starts from this: `main`, a name under motion.phrases, `live`, `vary`, `granular`, "
    "`path` or `improvise`. A phrase begins at its start; one that plays already goes on.",
    follower="stage",
    names=("phrases", "phrase"),
)
LOOK = Lever(
    "look",
    kind.name("look"),
    "",
    "how the projection looks",
    "/look",
    LOOK_FADE_S,
    cue="look",
    in_cue="Name of the look.",
    names=("looks", "look"),
    listed="look",
    stays=True,
    said=lambda name, s: f"The look {name} comes over {s:g} s.",
)
CARD = Lever(
    "card",
    kind.name("card", NO_CARD),
    "",
    "a card over the dance, like a title; `blank` is black, `none` takes it off",
    "/card",
    LOOK_FADE_S,
    cue="card",
    in_cue="Name of the card over the dance; none: no card.",
    names=("cards", "card"),
    listed="card",
    none=NO_CARD,
    stays=True,
    said=lambda name, s: f"The card {name} comes over {s:g} s." if name else f"The card goes over {s:g} s.",
)
CAMERA: Lever[Mapping[str, float | str]] = Lever(
    "camera",
    kind.fields(STAND),
    {},
    "where the camera stands, whatever the look ([looks.md](looks.md#camera))",
    "/camera",
    LOOK_FADE_S,
    cue="camera",
    in_cue="Where the camera stands from now on, whatever the look, like {angle_deg: 90, figure: 0.4}; "
    "{}: as the look says.",
    said=lambda _, s: f"The camera moves over {s:g} s.",
)
LIGHTS = Lever(
    "lights",
    kind.name("light mappings"),
    "",
    "which light mappings are in force",
    "/lights",
    LOOK_FADE_S,
    cue="lights",
    in_cue="Name of the set of light mappings.",
    names=("lights", "set of light mappings"),
    stays=True,
    said=lambda name, s: f"The lights {name} come over {s:g} s.",
)
MASTER = Lever(
    "master",
    kind.number("brightness", 0, 1),
    1.0,
    "brightness of picture and lights",
    "/master",
    cue="master",
    in_cue="Brightness of lights and picture, 0 to 1.",
    stays=True,
    said=lambda level, _: f"Master goes to {100 * level:.0f} %.",
)
STRINGS = Lever(
    "strings",
    kind.number("loudness", 0, 1),
    1.0,
    "how loud the strings are; master comes on top",
    "/strings",
    cue="strings",
    in_cue="How loud the strings are, 0 to 1.",
    stays=True,
    said=lambda level, _: f"The strings go to {100 * level:.0f} %.",
)
HAND = Lever(
    "hand",
    kind.switch("joint"),
    True,
    "the hand of this joint holds, or lets go; joint by name or number",
    "/hold",
    AT_ONCE,
    cue="hands",
    in_cue="Joints whose hands hold in this cue; the other hands let go. []: all let go.",
    follower="stage",
)  # a family: each joint has its own
SPRINGS = Lever(
    "springs",
    kind.name("setting"),
    "",
    "the springs among the hands go over to another setting, with its own wind, gravity, feedback and kick",
    "/springs",
    cue="springs",
    in_cue="Setting of the springs that are among the hands.",
    follower="stage",
    names=("springs", "setting of springs"),
    ends=("stiffness", "storm", "feedback", "wind", "gravity"),
    said=lambda name, _: f"The springs are {name}.",
)
STIFFNESS = Lever(
    "stiffness",
    kind.number("times the setting's", 0.1, 10),
    1.0,
    "looser or stiffer than the setting: times its directional stiffness. Until the next setting",
    "/springs/stiffness",
    KNOB_S,
    follower="stage",
    needs=_SPRUNG,
)
STORM = Lever(
    "storm",
    kind.number("strength", 0, 1),
    0.0,
    "a storm over the setting: gusts up to twice 9, 1, 4 m/s. Until the next setting",
    "/springs/storm",
    KNOB_S,
    follower="stage",
    needs=_SPRUNG,
)
FEEDBACK = Lever(
    "feedback",
    kind.number("gain", 0, 1),
    0.0,
    "how strongly the strings pull their bones back. Until the next setting",
    "/springs/feedback",
    KNOB_S,
    follower="stage",
    needs=_SPRUNG,
)
WIND = Lever(
    "wind",
    kind.several(VELOCITY),
    (0.0, 0.0, 0.0),
    "the air moves; y is up. Until the next setting",
    "/springs/wind",
    AT_ONCE,
    follower="stage",
    needs=_SPRUNG,
)
GRAVITY = Lever(
    "gravity",
    kind.number("downwards, m/s^2", -20, 20),
    9.81,
    "9.81 is the earth's. Until the next setting",
    "/springs/gravity",
    AT_ONCE,
    follower="stage",
    needs=_SPRUNG,
)
ITERATIONS = Lever(
    "iterations",
    kind.pair(
        Number("coding", 0, MOST_ITERATIONS, is_whole=True),
        Number("interaction", 0, MOST_ITERATIONS, is_whole=True),
    ),
    (1, 0),
    "as in `show.yaml`; no more than the tick's budget allows",
    "/iterations",
    is_faded_by_osc=False,
    cue="iterations",
    in_cue="Coding and interaction iterations, reached in whole steps; more than fit are lowered.",
    follower="stage",
)
LIVELINESS = Lever(
    "liveliness",
    kind.number("liveliness", 0, 1),
    1.0,
    "how alive the answer to a hand is: 1 as the dancer, 0 calm, without noise; a fade takes 0.5 s at least",
    "/liveliness",
    cue="liveliness",
    in_cue="How alive the answer to a hand is, 0 to 1.",
    follower="stage",
    said=lambda level, _: f"The liveliness goes to {100 * level:.0f} %.",
)
SEED = Lever(
    "seed",
    kind.whole("seed", 0, SEEDS - 1),
    0,
    "seed of the noise in the answer: another seed, another dance. The change takes 2 s",
    "/seed",
    AT_ONCE,
    cue="seed",
    in_cue="Seed of the noise in the answer: another number, another dance. The change takes 2 s.",
    follower="stage",
    said=lambda seed, _: f"The answer goes over to the seed {seed}.",
)
_PARTNERED = Need("has_partner", cure="No puppet of this show has a `partner`. Add one under puppets.")
_GOES_ON = Need("goes_on", cure="No puppet of this show goes on by itself. Add `goes_on: {}` under motion.")
MOST_DELAY_S = 2.0  # the steps that the stage remembers reach no further back
FOLLOW = Lever(
    "follow",
    kind.number("how closely", 0, 1),
    1.0,
    "how closely the partner answers: 1 as a partner would, 0.5 not at all, 0 what a partner would not do",
    "/partner/follow",
    AT_ONCE,
    cue="follow",
    in_cue="How closely the partner answers: 1 as a partner would, 0.5 not at all, 0 contrast.",
    follower="stage",
    needs=_PARTNERED,
    said=lambda value, _: f"The partner follows by {value:g}.",
)
LEAD = Lever(
    "lead",
    kind.number("share of the time", 0, 1),
    0.0,
    "share of the time in which the partner leads, and is answered; in turns of 8 s",
    "/partner/lead",
    AT_ONCE,
    cue="lead",
    in_cue="Share of the time in which the partner leads, and is answered.",
    follower="stage",
    needs=_PARTNERED,
    said=lambda value, _: f"The partner leads for {100 * value:.0f} % of the time.",
)
DELAY = Lever(
    "delay",
    kind.number("seconds", 0, MOST_DELAY_S),
    0.0,
    "how much later the partner answers",
    "/partner/delay",
    AT_ONCE,
    cue="delay",
    in_cue="How much later the partner answers, in seconds.",
    follower="stage",
    needs=_PARTNERED,
    said=lambda value, _: f"The partner answers {value:g} s later.",
)
GOAL: Lever[tuple[float, ...]] = Lever(
    "goal",
    kind.several((Number("x in metres", -20, 20), Number("z in metres", -20, 20)), optional=2),
    (),
    "the puppet goes there, dancing, and dances there: metres on the stage, to the right as the audience "
    "sees it, and towards the audience. Nothing: back to its phrase, from where it stands",
    "/goal",
    AT_ONCE,
    cue="goal",
    in_cue="x and z of the place to which the puppet goes, in metres on the stage. []: back to its phrase.",
    follower="stage",
    needs=_GOES_ON,
    said=lambda place, _: (
        f"The puppet goes to {place[0]:g}, {place[1]:g} m." if place else "The puppet has no goal."
    ),
)
TEMPERATURE = Lever(
    "temperature",
    kind.number("temperature", 0, 2),
    1.0,
    "how freely a puppet goes on by itself: 1 as it learned, 0 always the likeliest, above 1 wilder",
    "/goes_on/temperature",
    AT_ONCE,
    cue="temperature",
    in_cue="How freely a puppet goes on by itself: 1 as it learned, 0 always the likeliest.",
    follower="stage",
    said=lambda value, _: f"The temperature is {value:g}.",
)
TOP_P = Lever(
    "top_p",
    kind.number("share", 0.05, 1),
    0.95,
    "how much of what it might do next it considers: 1 all of it, 0.5 the likelier half",
    "/goes_on/top_p",
    AT_ONCE,
    cue="top_p",
    in_cue="How much of what a puppet that goes on by itself might do next it considers, 0.05 to 1.",
    follower="stage",
    said=lambda value, _: f"{100 * value:.0f} % of what may come is considered.",
)
CONTINUING: tuple[Lever[Any], ...] = (FOLLOW, LEAD, DELAY, GOAL, TEMPERATURE, TOP_P)
RATE = Lever(
    "rate",
    kind.optional_number("rate", -4, 4),
    None,
    "speed of playback",
    "/player/rate",
    AT_ONCE,
    follower="stage",
)


def _made(source: str, parameter: str) -> Lever[float]:
    """A number of a source that the generator makes motion from."""
    about = PARAMETERS[source][parameter]
    return Lever(
        f"{MOTION} {source} {parameter}",
        kind.number(parameter, about.least, about.most),
        float(about.default),
        about.meaning,
        f"/motion/{source}/{parameter}",
        follower="generator",
        needs=Need("phrases", ("source of motion", source)),
        said=lambda value, s: (
            f"The {parameter} of {source} goes to {value:g}{f' over {s:g} s' if s else ''}."
        ),
    )


def _points_said(points: tuple[float, ...], seconds: float) -> str:
    count = len(points) // 2
    messages = {0: "The path is the phrase's own again.", 1: "The path stays at this point of the map."}
    return messages.get(count, f"The path is a line of {count} points, there and back.")


MADE_NUMBERS: dict[str, dict[str, Lever[float]]] = {
    source: {parameter: _made(source, parameter) for parameter in parameters}
    for source, parameters in PARAMETERS.items()
}
PATH_POINTS: Lever[tuple[float, ...]] = Lever(
    f"{MOTION} {PATH} {POINTS}",
    kind.several(_POINT * MOST_POINTS, optional=2 * MOST_POINTS),
    (),
    "one point: the pose at that place of the dancer's map, with the wobble; more: a line over the map, "
    "there and back; nothing: the phrase's own path again",
    "/motion/path",
    AT_ONCE,
    follower="generator",
    needs=Need("phrases", ("source of motion", PATH)),
    said=_points_said,
)
AGAIN = Lever(
    f"{MOTION} again",
    kind.whole("times", 0, MOST_AGAIN),
    0,
    fade_s=AT_ONCE,
    follower="generator",
)
LEVERS: tuple[Lever[Any], ...] = (
    *(GOING, CUE, PHRASE, HAND, SPRINGS, STIFFNESS, STORM, FEEDBACK, WIND, GRAVITY),
    *(ITERATIONS, LIVELINESS, SEED, RATE),
    *CONTINUING,
    *(LOOK, CAMERA, CARD, LIGHTS, STRINGS, MASTER),
    *(lever for source in MADE for lever in MADE_NUMBERS[source].values()),
    *(PATH_POINTS, AGAIN),
)
_BY_NAME: dict[str, Lever[Any]] = {lever.name: lever for lever in LEVERS}


def hand(joint: str) -> Lever[bool]:
    """Whether the hand of a joint holds."""
    holding: kind.Kind[bool] = replace(HAND.kind, formatted=lambda holds: (joint, (float(holds),)))
    return replace(
        HAND,
        name=f"{HAND.name} {joint}",
        kind=holding,
        said=lambda holds, _: f"The hand of {joint} {'holds' if holds else 'lets go'}.",
    )


def find_lever(name: str) -> Lever[Any] | None:
    """The lever of this name; None: another release had it."""
    found = _BY_NAME.get(name)
    if found is None and name.startswith(f"{HAND.name} "):
        return hand(name.removeprefix(f"{HAND.name} "))
    return found
