"""show.yaml as typed, bounded configuration, and the show bundle's folder around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import field_validator, model_validator

from appliance.levers.sources import MAIN
from appliance.pose.body_facts import with_stance
from appliance.pose.bvh import BvhError, read_bvh
from appliance.pose.foreign_file import require_inside
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import COPY_AGAIN, no_such_show
from appliance.show.card import MOST_CARDS, CardConfig, cards_by_name
from appliance.show.config_error import ConfigError, Problem, did_you_mean
from appliance.show.cues import CueConfig, cue_problems
from appliance.show.dance import DancerConfig, MotionConfig
from appliance.show.hand import HandConfig
from appliance.show.lights import LightsConfig
from appliance.show.look import LookConfig, looks_by_name
from appliance.show.puppets import (
    MAX_HANDS,
    PuppetConfig,
    PuppetStart,
    mover_problems,
    puppet_problems,
    require_each_joint_once,
)
from appliance.show.section import MOST_PUPPETS, Section, each_name_once, key, part, refusal
from appliance.show.sound import StringsConfig
from appliance.show.springs import SpringsConfig, springs_by_name
from appliance.show.validation import validated
from appliance.show.yaml_file import Location, YamlFile, read_yaml


class ShowConfig(Section):
    """show.yaml."""

    name: str = key("Name of the show.", length=(1, 100))
    acknowledgement: str = key("Whom to thank for the recordings.", "", length=(0, 4000))
    dancer: DancerConfig = part(DancerConfig)
    motion: MotionConfig = part(MotionConfig)
    hands: list[HandConfig] = key(
        "Which puppeteer holds which joint, each joint at most once.", [], length=(0, MAX_HANDS)
    )
    puppets: list[PuppetConfig] = key(
        "Several figures on the stage, the one that cues and commands lead first. []: one, where its phrase "
        "has it.",
        [],
        length=(0, MOST_PUPPETS),
    )
    springs: list[SpringsConfig] = key(
        "Settings of the springs that are among the hands. []: the built-in loose, stiff and storm.",
        [],
        length=(0, 32),
    )
    looks: list[LookConfig] = key(
        "How the projection looks; the first one is shown at the start. "
        "[]: the built-in looks, under the names of their styles.",
        [],
        length=(0, 32),
    )
    cards: list[CardConfig] = key(
        "Overlays that cues show over the dance: titles, logos, black. `blank` is there without being named.",
        [],
        length=(0, MOST_CARDS),
    )
    lights: LightsConfig = part(LightsConfig)
    strings: StringsConfig | None = key("Strings that the dance plays (`bunraku sound`); null: none.", None)
    cues: list[CueConfig] = key(
        "Changes that show control can call up by name, in order.", [], length=(0, 200)
    )

    @field_validator("hands")
    @classmethod
    def _each_joint_once(cls, hands: list[HandConfig]) -> list[HandConfig]:
        return require_each_joint_once(hands)

    _each_puppet_once = field_validator("puppets")(each_name_once("puppets"))

    @model_validator(mode="after")
    def _one_primary(self) -> ShowConfig:
        primaries = [at for at, hand in self.hands_at if hand.primary]
        if len(primaries) > 1:
            raise refusal(
                "Two hands are primary.", "The tick can follow one sensor: keep one.", at=primaries[1]
            )
        return self

    _each_setting_once = field_validator("springs")(each_name_once("settings of springs"))

    @model_validator(mode="after")
    def _springs_as_set(self) -> ShowConfig:
        """At most one hand of a puppet is springs, and its setting is there."""
        names, seen = list(springs_by_name(self.springs)), set()
        for at, setting in [(at, hand.springs) for at, hand in self.hands_at if hand.springs is not None]:
            if at[:-1] in seen:
                raise refusal(
                    "Two hands are springs.",
                    "Keep one: it holds all joints below its own.",
                    at=(*at, "springs"),
                )
            seen.add(at[:-1])
            if setting not in names:
                raise refusal(
                    f"This show has no setting of springs '{setting}'.",
                    did_you_mean(setting, names),
                    at=(*at, "springs"),
                )
        return self

    _each_look_once = field_validator("looks")(each_name_once("looks"))
    _each_card_once = field_validator("cards")(each_name_once("cards"))

    @property
    def cast(self) -> tuple[PuppetStart, ...]:
        """Each puppet as it starts; the show's own sections describe the one that cues lead."""
        motion, times = self.motion, (self.dancer.coding_iterations, self.dancer.interaction_iterations)
        name, position = (self.puppets[0].name, self.puppets[0]) if self.puppets else ("", None)
        led = PuppetStart(
            0, name, True, motion.source, motion.start_s, self.hands, ("hands",), times, position
        )
        others = (
            PuppetStart(
                number=number,
                name=puppet.name,
                is_led=False,
                source=puppet.phrase or MAIN,
                start_s=puppet.start_s,
                hands=puppet.hands,
                hands_at=("puppets", number, "hands"),
                iterations=puppet.iterations or times,
                position=puppet,
            )
            for number, puppet in enumerate(self.puppets[1:], 1)
        )
        return (led, *others)

    @property
    def led(self) -> PuppetStart:
        """The puppet that cues and orders lead."""
        return next(puppet for puppet in self.cast if puppet.is_led)

    @property
    def answerer(self) -> tuple[int, int, PuppetConfig] | None:
        """The puppet with a partner: its number, its partner's, and its keys."""
        names = [puppet.name for puppet in self.puppets]
        for number, puppet in enumerate(self.puppets):
            if puppet.partner is not None:
                return number, names.index(puppet.partner), puppet
        return None

    @property
    def hands_at(self) -> Iterator[tuple[Location, HandConfig]]:
        """All hands of all puppets, and their places in the file."""
        for puppet in self.cast:
            yield from (((*puppet.hands_at, place), hand) for place, hand in enumerate(puppet.hands))

    @property
    def primary_sensor(self) -> str | None:
        """Name of the sensor that the tick's phase follows; None without sensors."""
        worn = [hand for _, hand in self.hands_at if hand.sensor]
        sensors = sorted(worn, key=lambda hand: not hand.primary)
        return sensors[0].sensor if sensors else None

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """The values a cue may name under each key, the one in force at start first."""
        at_start = [hand.springs for hand in self.hands if hand.springs]
        return {
            "phrase": self.motion.sources,
            "hands": tuple(dict.fromkeys(hand.joint for hand in self.hands)),
            "springs": tuple(dict.fromkeys([*at_start, *springs_by_name(self.springs)])) if at_start else (),
            "look": tuple(looks_by_name(self.looks)),
            "card": tuple(cards_by_name(self.cards)),
            "lights": tuple(mapping.name for mapping in self.lights.mappings),
        }


@dataclass(frozen=True)
class Show:
    """A show bundle that was read: its configuration, its files, its skeleton."""

    config: ShowConfig
    directory: Path
    skeleton: Skeleton
    file: YamlFile

    @property
    def network(self) -> Path:
        """The puppet's ONNX file."""
        return self.directory / self.config.dancer.network

    @property
    def phrase(self) -> Path:
        """The BVH file that playback starts from."""
        return self.directory / self.config.motion.phrase

    @property
    def phrases(self) -> dict[str, Path]:
        """All phrases' BVH files by their names, the one that playback starts from first."""
        return {name: self.directory / file for name, file in self.config.motion.files.items()}

    @property
    def motion_networks(self) -> dict[str, Path]:
        """The networks of the sources that the generator makes, by source."""
        sources = self.config.motion.made_sources
        return {name: self.directory / section.network for name, section in sources.items()}

    @property
    def improviser(self) -> Path:
        """The network with which puppets go on by themselves, in the stage."""
        motion = self.config.motion
        section = motion.goes_on or motion.improvise
        return self.directory / (section.network if section else "improviser.onnx")

    @property
    def partner(self) -> Path:
        """The network that has learned to answer another dancer."""
        return self.directory / "partner.onnx"

    def require_moving(self, joints: Sequence[str]) -> None:
        """Refuse hands on joints that the network does not move; `joints` are those that it does."""
        message = "The network does not move the joint '{}'."
        problems = [
            self.file.problem((*at, "joint"), message.format(hand.joint), did_you_mean(hand.joint, joints))
            for at, hand in self.config.hands_at
            if hand.joint not in joints
        ]
        if problems:
            raise ConfigError(problems)

    def doubtful_hands(self) -> list[Problem]:
        """Hands that do something else than leading the body: warnings."""
        return [*self._idle_hands(), *self._turning_the_figure()]

    def doubtful_strings(self) -> list[Problem]:
        """Cues in which the strings are to sound and that the show lacks: warnings."""
        names = [cue.name for cue in self.config.cues]
        return [
            self.file.problem(
                ("strings", "cues", place),
                f"The strings are to sound in the cue '{cue}', which this show does not have.",
                did_you_mean(cue, names),
            )
            for place, cue in enumerate(self.config.strings.cues if self.config.strings else ())
            if cue not in names
        ]

    def _turning_the_figure(self) -> list[Problem]:
        """Hands on the root, which all else hangs on: the network hardly minds where a figure faces."""
        skeleton = self.skeleton
        above = [j for j, parent in enumerate(skeleton.parents) if parent == 0]
        highest = max(above, key=lambda j: float(skeleton.offsets[j][1]), default=0)
        message = (
            f"'{skeleton.names[0]}' is the root of the skeleton: a hand there turns the whole figure, and "
            "the rest of the body hardly answers."
        )
        cure = f"To lead the body hold '{skeleton.names[highest]}'; to turn the figure leave it as it is."
        return [
            self.file.problem((*at, "joint"), message, cure)
            for at, hand in self.config.hands_at
            if hand.joint == skeleton.names[0] and hand.kind not in ("kept", "springs")
            if hand.by == "orientation"  # a position draws the figure there, which is what is meant
        ]

    def _idle_hands(self) -> list[Problem]:
        """Places where hands hold joints although no iteration is interactive: they move nothing.

        A show may begin like this on purpose, so this is a warning. A cue without hands says `hands: []`.
        """
        if not self.config.hands:
            return []
        problems = []
        dancer = self.config.dancer
        if dancer.interaction_iterations == 0:
            message = "The hands move nothing: interaction_iterations is 0."
            cure = f"Write {max(dancer.coding_iterations - 1, 1)}, or remove the hands."
            problems.append(self.file.problem(("dancer", "interaction_iterations"), message, cure))
        for place, cue in enumerate(self.config.cues):
            if cue.iterations is not None and cue.iterations[1] == 0 and cue.hands != []:
                message = (
                    f"The hands move nothing in the cue '{cue.name}': none of its iterations is interactive."
                )
                coding = cue.iterations[0]
                cure = f"Write [{coding}, {max(coding - 1, 1)}], or `hands: []` where they are to let go."
                problems.append(self.file.problem(("cues", place, "iterations"), message, cure))
        return problems


def load_show(directory: Path | str) -> Show:
    """Read a show bundle: show.yaml and skeleton.bvh; network and phrase are only known to be there.

    Raises ConfigError with file, line, what is wrong and what to do, for all that is wrong at once.
    """
    directory = Path(directory)
    if not directory.is_dir():
        raise ConfigError([no_such_show(directory)])
    file = read_yaml(directory / "show.yaml", directory)
    skeleton, problems = _skeleton(directory / "skeleton.bvh")
    context = {"directory": directory, "joints": skeleton.names if skeleton else None}
    try:
        config = validated(ShowConfig, file, context)
    except ConfigError as error:
        problems.extend(error.problems)
    else:
        problems.extend(cue_problems(config.cues, config.names, file))
        problems.extend(
            puppet_problems(config.puppets, config.cast, config.motion, config.lights.mappings, file)
        )
        if config.strings is not None:
            problems.extend(
                mover_problems(config.strings.of, ("strings", "of"), config.cast, config.motion, file)
            )
    if problems or skeleton is None:
        raise ConfigError(problems)
    return Show(config, directory, skeleton, file)


def _skeleton(path: Path) -> tuple[Skeleton | None, list[Problem]]:
    cure = COPY_AGAIN
    try:
        require_inside(path, path.parent)
        return with_stance(read_bvh(path)), []
    except BvhError as error:
        return None, [Problem(path, error.line, str(error).split(": ", 1)[-1], cure)]
    except OSError as error:
        return None, [Problem(path, 0, f"The skeleton cannot be read ({error.strerror}).", cure)]
