"""Cues: what show control can call up at one word, and whether all that they name is there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated

from pydantic import Field, field_validator

from appliance.show.config_error import Problem, did_you_mean
from appliance.show.look import CameraChange
from appliance.show.motion_sources import MotionChanges
from appliance.show.section import Section, key, refusal
from appliance.show.sources import NO_CARD, SEEDS
from appliance.show.yaml_file import Location, YamlFile

FADE_S = 2.0
MOST_ITERATIONS = 64  # as often as DancerConfig admits

Name = Annotated[str, Field(min_length=1, max_length=64)]
_Times = Annotated[int, Field(ge=0, le=MOST_ITERATIONS)]


class CueConfig(Section):
    """One cue. What it leaves out stays as it is."""

    name: str = key("What `/cue` calls it.", length=(1, 64))
    phrase: Name | None = key(
        "What the puppet starts from: `main`, a name under motion.phrases, `live`, `vary`, `granular`, "
        "`path` or `improvise`. A phrase begins at its start; one that plays already goes on.",
        None,
    )
    motion: MotionChanges | None = key(
        "Parameters of the sources that are made ahead, like {vary: {sigma: 1.2}}, reached over the fade.",
        None,
    )
    iterations: Annotated[tuple[_Times, _Times], Field(strict=False)] | None = key(
        "Coding and interaction iterations, reached in whole steps; more than fit are lowered.", None
    )
    liveliness: float | None = key("How alive the answer to a hand is, 0 to 1.", None, within=(0, 1))
    seed: int | None = key(
        "Seed of the noise in the answer: another number, another dance. The change takes 2 s.",
        None,
        within=(0, SEEDS - 1),
    )
    hands: list[Name] | None = key(
        "Joints whose hands hold in this cue; the other hands let go. []: all let go.", None, length=(0, 8)
    )
    springs: Name | None = key("Setting of the springs that are among the hands.", None)
    look: Name | None = key("Name of the look.", None)
    camera: CameraChange | None = key(
        "Where the camera stands from now on, whatever the look, like {angle_deg: 90, figure: 0.4}; "
        "{}: as the look says.",
        None,
    )
    card: Name | None = key("Name of the card over the dance; none: no card.", None)
    lights: Name | None = key("Name of the set of light mappings.", None)
    strings: float | None = key("How loud the strings are, 0 to 1.", None, within=(0, 1))
    master: float | None = key("Brightness of lights and picture, 0 to 1.", None, within=(0, 1))
    fade_s: float = key(
        "How long phrase, iterations, liveliness, springs, strings, look, camera, card, lights and master "
        "take to change, in seconds. "
        "Hands take 0.5 s to hold and 1 s to let go, whatever stands here.",
        FADE_S,
        within=(0, 60),
    )

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
        for what, location, word in _named(cue, place):
            if word not in known[what]:
                cure = did_you_mean(word, known[what]) if known[what] else f"Remove `{what}` from the cue."
                yield file.problem(location, _UNKNOWN[what].format(word), cure)


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


_UNKNOWN = {
    "phrase": "This show has no phrase '{}'.",
    "hands": "No hand of this show holds the joint '{}'.",
    "look": "This show has no look '{}'.",
    "card": "This show has no card '{}'.",
    "lights": "This show has no set of light mappings '{}'.",
    "springs": "This show has no setting of springs '{}'.",
}


def _named(cue: CueConfig, place: int) -> Iterator[tuple[str, Location, str]]:
    """Each name in a cue: its key, where it stands, the name."""
    for what in ("phrase", "look", "card", "lights", "springs"):
        word = getattr(cue, what)
        if word is not None and (what, word) != ("card", NO_CARD):
            yield what, ("cues", place, what), word
    for hand, joint in enumerate(cue.hands or ()):
        yield "hands", ("cues", place, "hands", hand), joint
