"""show.yaml's section about the puppets: several figures of one network, each at its place on the stage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, field_validator

from appliance.levers.table import MOST_DELAY_S, MOST_ITERATIONS
from appliance.show.config_error import Problem, did_you_mean
from appliance.show.cues import require_coding_then_interaction
from appliance.show.dance import MotionConfig
from appliance.show.hand import HandConfig
from appliance.show.light_rules import MappingConfig
from appliance.show.section import Section, key, refuse_repeats
from appliance.show.yaml_file import Location, YamlFile

MAX_HANDS = 8
LED_BY_THE_SHOW = ("phrase", "start_s", "hands", "iterations")  # keys that the first puppet must not have
_Times = Annotated[int, Field(ge=0, le=MOST_ITERATIONS)]


class PuppetConfig(Section):
    """A figure on the stage. The first dances what `motion`, `hands` and `dancer` say; cues lead it."""

    name: str = key("Name for lights and receivers.", length=(1, 32))
    x: float = key(
        "Start of its phrase on the stage, metres to the right as the audience sees it.",
        0.0,
        within=(-20, 20),
    )
    z: float = key("The same, metres towards the audience.", 0.0, within=(-20, 20))
    turned: float = key(
        "Rotation of its dance to the dancer's left, degrees; 180 shows its back.",
        0.0,
        within=(-360, 360),
    )
    space: float = key(
        "Room that it keeps around its hips, metres: two puppets stay apart by the sum of theirs, led apart "
        "before they meet. 0: it dances through others.",
        0.3,
        within=(0, 2),
    )
    phrase: str | None = key(
        "Not for the first puppet: its motion source, `main`, a name under motion.phrases, `live`, `vary`, "
        "`granular`, `path`, `improvise` or a name under motion.kept. null: the phrase that the show starts "
        "with.",
        None,
        length=(1, 64),
    )
    start_s: float = key(
        "Not for the first puppet: the second of its phrase at which it begins; two puppets in the same "
        "phrase become a canon.",
        0.0,
        within=(0, 86400),
    )
    partner: str | None = key(
        "Name of the puppet that this one answers, by a network that has learned from couples "
        "(docs/partner.md). Its phrase only begins the dance. One puppet of a show may have a partner.",
        None,
        length=(1, 32),
    )
    follow: float = key(
        "How closely it answers its partner. 1: as a partner would; 0.5: not at all; 0: it does what a "
        "partner would not.",
        1.0,
        within=(0, 1),
    )
    lead: float = key(
        "Share of the time in which it leads instead, and its partner answers it. A live dancer does not.",
        0.0,
        within=(0, 1),
    )
    delay: float = key("How much later it answers, in seconds.", 0.0, within=(0, MOST_DELAY_S))
    hands: list[HandConfig] = key(
        "Not for the first puppet: which puppeteer holds which of its joints. A sensor may lead several "
        "puppets.",
        [],
        length=(0, MAX_HANDS),
    )
    iterations: Annotated[tuple[_Times, _Times], Field(strict=False)] | None = key(
        "Not for the first puppet: coding and interaction iterations; null: as many as the first one's at "
        "the start.",
        None,
    )

    @field_validator("hands")
    @classmethod
    def _each_joint_once(cls, hands: list[HandConfig]) -> list[HandConfig]:
        return require_each_joint_once(hands)

    @field_validator("iterations")
    @classmethod
    def _coding_then_interaction(cls, times: tuple[int, int] | None) -> tuple[int, int] | None:
        return require_coding_then_interaction(times, "A puppet")


@dataclass(frozen=True)
class PuppetStart:
    """A puppet as it starts, whichever sections of show.yaml say it.

    number: its place in joint frames, journals and receivers' addresses. name: "" of one without a name.
    is_led: cues and orders lead it. source: what it starts from, a name in `motion.sources`. hands_at: where
    its hands are in the file. position: None where its phrase has it.
    """

    number: int
    name: str
    is_led: bool
    source: str
    start_s: float
    hands: Sequence[HandConfig]
    hands_at: Location
    iterations: tuple[int, int]
    position: PuppetConfig | None


def require_each_joint_once(hands: list[HandConfig]) -> list[HandConfig]:
    """The hands of one puppet; no joint is held twice by orientation or twice by position.

    Raises a refusal.
    """
    refuse_repeats(
        [(hand.joint, hand.by) for hand in hands],
        "Two hands hold the joint '{value[0]}' by {value[1]} (hands[{first}] and hands[{place}]).",
        "Give one of them another joint, or let one hold by orientation and the other by position.",
    )
    return hands


def _light_problems(
    puppets: Sequence[PuppetConfig],
    cast: Sequence[PuppetStart],
    motion: MotionConfig,
    mappings: Sequence[MappingConfig],
    file: YamlFile,
) -> Iterator[Problem]:
    names = [puppet.name for puppet in puppets]
    for place, mapping in enumerate(mappings):
        for number, rule in enumerate(mapping.rules):
            if rule.puppet is not None and rule.puppet not in names:
                cure = did_you_mean(rule.puppet, names) if names else "Remove it: the show has one puppet."
                at = ("lights", "mappings", place, "rules", number, "puppet")
                yield file.problem(at, f"The show has no puppet '{rule.puppet}'.", cure)
            of = ("lights", "mappings", place, "rules", number, "of")
            yield from mover_problems(rule.of, of, cast, motion, file, rule.puppet, rule.joint)


def mover_problems(
    of: str | None,
    at: Location,
    cast: Sequence[PuppetStart],
    motion: MotionConfig,
    file: YamlFile,
    puppet: str | None = None,
    joint: str | None = None,
) -> Iterator[Problem]:
    """A live dancer that the show does not take, or a hand that it does not have. at: of the key `of`."""
    if of == "live" and not motion.live:
        yield file.problem(at, "This show takes no live dancer.", "Add `live: true` under motion.")
    read = (one for one in cast if (one.is_led if puppet is None else one.name == puppet))
    hands = [hand.joint for one in read for hand in one.hands]
    if of == "hand" and (not hands if joint is None else joint not in hands):
        cure = did_you_mean(joint, hands) if joint and hands else "Add one under `hands`, or remove `of`."
        yield file.problem(at, f"No hand holds {joint or 'a joint of it'}.", cure)


def _partner_problems(puppets: Sequence[PuppetConfig], file: YamlFile) -> Iterator[Problem]:
    names = [puppet.name for puppet in puppets]
    answering = [place for place, puppet in enumerate(puppets) if puppet.partner is not None]
    for place in answering:
        at, own = ("puppets", place, "partner"), puppets[place]
        if place != answering[0]:
            message = (
                f"'{own.name}' answers '{own.partner}', but '{names[answering[0]]}' is a partner already."
            )
            yield file.problem(at, message, "Keep one `partner` in the show.")
        elif own.partner == own.name or own.partner not in names:
            others = [name for name in names if name != own.name]
            message = f"'{own.name}' answers '{own.partner}', which is no other puppet."
            yield file.problem(at, message, did_you_mean(own.partner or "", others))


def puppet_problems(
    puppets: Sequence[PuppetConfig],
    cast: Sequence[PuppetStart],
    motion: MotionConfig,
    mappings: Sequence[MappingConfig],
    file: YamlFile,
) -> Iterator[Problem]:
    """Settings that the first puppet must not have, phrases of the others that the show lacks, and puppets,
    hands and a live dancer that it lacks in rules of lights.
    """
    yield from _light_problems(puppets, cast, motion, mappings, file)
    yield from _partner_problems(puppets, file)
    for place, puppet in enumerate(puppets):
        if place == 0:
            for name in (name for name in LED_BY_THE_SHOW if name in puppet.model_fields_set):
                message = f"'{name}' does not stand with the first puppet: it dances what the show says."
                cure = "Write it under `motion`, `hands` or `dancer`, or give it to another puppet."
                yield file.problem(("puppets", 0, name), message, cure)
        elif puppet.phrase is not None and puppet.phrase not in motion.sources:
            message = (
                f"The puppet '{puppet.name}' starts from '{puppet.phrase}', which the show does not have."
            )
            cure = did_you_mean(puppet.phrase, motion.sources)
            yield file.problem(("puppets", place, "phrase"), message, cure)
        for number, hand in enumerate(puppet.hands if place else ()):
            if not hand.from_start:
                message = "Nothing lets this hand hold: cues and `/hold` lead the hands of the first puppet."
                at = ("puppets", place, "hands", number, "from_start")
                yield file.problem(at, message, "Remove it, or give the hand to the first puppet.")
