"""Cues: what show control can call up at one word, and whether all that they name is there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field, field_validator

from appliance.levers import table as levers
from appliance.levers.lever import Lever
from appliance.levers.table import MOST_ITERATIONS
from appliance.show.config_error import Problem, did_you_mean
from appliance.show.look import CameraChange
from appliance.show.motion_sources import MotionChanges
from appliance.show.remote import CueTime
from appliance.show.section import Section, key, refusal
from appliance.show.yaml_file import Location, YamlFile

FADE_S = 2.0

Name = Annotated[str, Field(min_length=1, max_length=64)]
_Metres = Annotated[float, Field(ge=-20, le=20)]
_Times = Annotated[int, Field(ge=0, le=MOST_ITERATIONS)]


def _key(lever: Lever[Any], **bounds: Any) -> Any:
    """A lever's key in a cue: its sentence, and its bounds where it is one number."""
    if len(lever.kind.numbers) == 1 and not lever.kind.text:
        bounds = {"within": lever.kind.numbers[0][1:3]}
    return key(lever.in_cue, None, **bounds)


class CueConfig(Section):
    """One cue. Keys left out stay as they are."""

    name: str = key("Name for `/cue`.", length=(1, 64))
    at: CueTime | None = key(
        'Timecode at which it is called, like "01:00:10:00", where the box file has `timecode`.', None
    )
    phrase: Name | None = _key(levers.PHRASE)
    motion: MotionChanges | None = key(
        "Parameters of sources made ahead, like {vary: {sigma: 1.2}}, reached over the fade.",
        None,
    )
    iterations: Annotated[tuple[_Times, _Times], Field(strict=False)] | None = _key(levers.ITERATIONS)
    liveliness: float | None = _key(levers.LIVELINESS)
    seed: int | None = _key(levers.SEED)
    follow: float | None = _key(levers.FOLLOW)
    lead: float | None = _key(levers.LEAD)
    delay: float | None = _key(levers.DELAY)
    goal: list[_Metres] | None = _key(levers.GOAL, length=(0, 2))
    temperature: float | None = _key(levers.TEMPERATURE)
    top_p: float | None = _key(levers.TOP_P)
    hands: list[Name] | None = _key(levers.HAND, length=(0, 8))
    springs: Name | None = _key(levers.SPRINGS)
    look: Name | None = _key(levers.LOOK)
    camera: CameraChange | None = _key(levers.CAMERA)
    card: Name | None = _key(levers.CARD)
    lights: Name | None = _key(levers.LIGHTS)
    strings: float | None = _key(levers.STRINGS)
    master: float | None = _key(levers.MASTER)
    fade_s: float = key(
        "How long phrase, iterations, liveliness, springs, strings, look, camera, card, lights and master "
        "take to change, in seconds. "
        "Hands take 0.5 s to hold and 1 s to let go, regardless of this value.",
        FADE_S,
        within=(0, 60),
    )

    @field_validator("goal")
    @classmethod
    def _x_and_z(cls, goal: list[float] | None) -> list[float] | None:
        if goal is not None and len(goal) == 1:
            raise refusal("A goal of one number is no place.", "Write x and z, or [] for none.")
        return goal

    @field_validator("iterations")
    @classmethod
    def _coding_then_interaction(cls, times: tuple[int, int] | None) -> tuple[int, int] | None:
        return require_coding_then_interaction(times, "A cue")


def require_coding_then_interaction(times: tuple[int, int] | None, what: str) -> tuple[int, int] | None:
    """Coding and interaction iterations that can be danced. Raises a refusal."""
    if times is not None and times[0] < 1:
        raise refusal(f"{what} cannot have 0 coding iterations: nothing would dance.", "Write 1 or more.")
    if times is not None and times[1] > times[0]:
        raise refusal(
            f"{times[1]} interaction iterations are more than {times[0]} coding iterations.",
            f"Write [{times[0]}, {max(times[0] - 1, 1)}], which leaves the last pass free.",
        )
    return times


def cue_problems(
    cues: Sequence[CueConfig], known: Mapping[str, Sequence[str]], file: YamlFile
) -> Iterator[Problem]:
    """Names in cues that the show does not have, and cues with the same name, each with its line.

    `known`: which names there are for the keys phrase, hands, springs, look, card and lights of a cue.
    """
    names = [cue.name for cue in cues]
    for place, cue in enumerate(cues):
        if cue.name in names[:place]:
            first = file.line(("cues", names.index(cue.name), "name"))
            message = f"Two cues are called '{cue.name}' (the first on line {first})."
            yield file.problem(("cues", place, "name"), message, "Give one of them another name.")
        for where, what, location, word in _named(cue, place):
            if word not in known[where]:
                cure = did_you_mean(word, known[where]) if known[where] else f"Remove `{where}` from the cue."
                text = f"This show has no {what} '{word}'."
                if where == levers.HAND.cue:
                    text = f"No hand of this show holds the joint '{word}'."
                yield file.problem(location, text, cure)


def too_much(cues: Sequence[CueConfig], most: int, file: YamlFile) -> Iterator[Problem]:
    """Cues that ask for more coding iterations than fit this machine: they run with fewer."""
    for place, cue in enumerate(cues):
        if cue.iterations is not None and cue.iterations[0] > most:
            message = (
                f"The cue '{cue.name}' asks for {cue.iterations[0]} coding iterations; {most} fit the tick's "
                "budget here, and it runs with those."
            )
            cure = "Ask for fewer, or give the box a faster machine."
            yield file.problem(("cues", place, "iterations"), message, cure)


def _named(cue: CueConfig, place: int) -> Iterator[tuple[str, str, Location, str]]:
    """Each name in a cue: its key, what it names, where it stands, the name."""
    for lever in levers.LEVERS:
        name = getattr(cue, lever.cue) if lever.cue and lever.names != ("", "") else None
        if name is not None and name != (lever.none or None):
            yield lever.cue, lever.names[1], ("cues", place, lever.cue), name
    for hand, joint in enumerate(cue.hands or ()):
        yield "hands", "", ("cues", place, "hands", hand), joint
