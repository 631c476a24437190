"""show.yaml as typed, bounded configuration, and the show bundle's folder around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import field_validator, model_validator

from appliance.pose.bvh import BvhError, read_bvh
from appliance.pose.foreign_file import require_inside
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import COPY_AGAIN
from appliance.show.config_error import ConfigError, Problem, did_you_mean
from appliance.show.cues import CueConfig, cue_problems
from appliance.show.dance import DancerConfig, MotionConfig
from appliance.show.lights import LightsConfig
from appliance.show.look import LookConfig, looks_by_name
from appliance.show.section import Axis, Joint, Orientation, Section, key, part, refusal, refuse_repeats
from appliance.show.validation import validated
from appliance.show.yaml_file import YamlFile, read_yaml

MAX_HANDS = 8
LONGEST_SENSOR_NAME = 24  # as in the key file (appliance/sensor/keys.py) and the wearable's flash
KINDS = ("sensor", "turning", "fixed", "kept", "osc")
SENSOR_KEYS = ("facing", "at_neutral", "neutral", "primary")  # of a hand, for a worn sensor alone


class TurningConfig(Section):
    """A hand that turns its joint at a constant rate."""

    axis: Axis = key("Axis (x, y, z) in the parent's frame, any length.", (0.0, 1.0, 0.0))
    seconds_per_turn: float = key("Seconds for one turn.", 5.0, within=(0.1, 3600))


class FixedConfig(Section):
    """A hand that holds its joint still."""

    orientation: Orientation = key("Local to the parent joint; order w, x, y, z.", (1.0, 0.0, 0.0, 0.0))


class HandConfig(Section):
    """A puppeteer's hold on one joint. Exactly one of sensor, turning, fixed, kept, osc names the holder."""

    sensor: str | None = key(
        "Name of the worn sensor that holds it, as in the key file.", None, length=(1, LONGEST_SENSOR_NAME)
    )
    turning: TurningConfig | None = key("The joint turns at a constant rate.", None)
    fixed: FixedConfig | None = key("The joint is held still.", None)
    kept: Literal[True] | None = key(
        "The joint is kept where the phrase has it, pose by pose; with as many interaction as "
        "coding iterations it stays there exactly.",
        None,
    )
    osc: Literal[True] | None = key("Messages to the control port hold the joint.", None)
    joint: Joint = key("Name of the held joint, one that the network moves.", length=(1, None))
    weight: float = key(
        "How firmly it is held: 0 not at all, 1 fully overwritten in each interaction.", 1.0, within=(0, 1)
    )
    facing: Axis = key(
        "For sensors: the axis of the sensor (x, y, z; x is the arrow on its case, z comes out "
        "of its lid) that points to the front while the dancer stands in the neutral pose.",
        (1.0, 0.0, 0.0),
    )
    at_neutral: Orientation = key(
        "For sensors: the joint's orientation, local to its parent (w, x, y, z), while the "
        "dancer stands in the neutral pose; [1, 0, 0, 0] is the skeleton's rest pose.",
        (1.0, 0.0, 0.0, 0.0),
    )
    neutral: Orientation = key(
        "For sensors: the sensor's own orientation (w, x, y, z in its axes: z up) that counts as "
        "the neutral pose until the dancer has stood still for one.",
        (1.0, 0.0, 0.0, 0.0),
    )
    primary: bool = key("For sensors: the tick's phase follows this one; otherwise the first one.", False)

    @model_validator(mode="before")
    @classmethod
    def _one_kind(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        given = [kind for kind in KINDS if values.get(kind) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none of them"
            raise refusal(
                f"A hand has exactly one of {', '.join(KINDS)}; this one has {found}.",
                "Name one puppeteer, and write a second hand for a second one.",
                at=given[1] if given else None,
            )
        for name in SENSOR_KEYS:
            if name in values and given != ["sensor"]:
                message = f"'{name}' belongs to a sensor, and this hand is {given[0]}."
                raise refusal(message, "Remove it.", at=name)
        return values

    @property
    def kind(self) -> str:
        """sensor, turning, fixed, kept or osc."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)


class ShowConfig(Section):
    """show.yaml."""

    name: str = key("What the show is called.", length=(1, 100))
    acknowledgement: str = key("Whom to thank for the recordings.", "", length=(0, 4000))
    dancer: DancerConfig = part(DancerConfig)
    motion: MotionConfig = part(MotionConfig)
    hands: list[HandConfig] = key(
        "Which puppeteer holds which joint, each joint at most once.", [], length=(0, MAX_HANDS)
    )
    looks: list[LookConfig] = key(
        "How the projection looks; the first one is shown at the start. "
        "[]: the built-in looks, under the names of their styles.",
        [],
        length=(0, 32),
    )
    lights: LightsConfig = part(LightsConfig)
    cues: list[CueConfig] = key("What show control can call up by name, in order.", [], length=(0, 200))

    @field_validator("hands")
    @classmethod
    def _each_joint_once(cls, hands: list[HandConfig]) -> list[HandConfig]:
        refuse_repeats(
            [hand.joint for hand in hands],
            "Two hands hold the joint '{value}' (hands[{first}] and hands[{place}]).",
            "Give one of them another joint.",
        )
        primaries = [place for place, hand in enumerate(hands) if hand.primary]
        if len(primaries) > 1:
            raise refusal(
                "Two hands are primary.", "The tick can follow one sensor: keep one.", at=primaries[1]
            )
        return hands

    @field_validator("looks")
    @classmethod
    def _each_look_once(cls, looks: list[LookConfig]) -> list[LookConfig]:
        refuse_repeats(
            [look.name for look in looks], "Two looks are called '{value}'.", "Give one another name."
        )
        return looks

    @property
    def primary_sensor(self) -> str | None:
        """Name of the sensor that the tick's phase follows; None without sensors."""
        sensors = sorted((hand for hand in self.hands if hand.sensor), key=lambda hand: not hand.primary)
        return sensors[0].sensor if sensors else None

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """What a cue may name under phrase, hands, look and lights, each first what is in force at start."""
        return {
            "phrase": self.motion.sources,
            "hands": tuple(hand.joint for hand in self.hands),
            "look": tuple(looks_by_name(self.looks)),
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

    def require_moving(self, joints: Sequence[str]) -> None:
        """Refuse hands on joints that the network does not move; `joints` are those that it does."""
        words = "The network does not move the joint '{}'."
        problems = [
            self.file.problem(
                ("hands", place, "joint"), words.format(hand.joint), did_you_mean(hand.joint, joints)
            )
            for place, hand in enumerate(self.config.hands)
            if hand.joint not in joints
        ]
        if problems:
            raise ConfigError(problems)

    def idle_hands(self) -> list[Problem]:
        """Places where hands hold joints although no iteration is interactive: they move nothing.

        A show may begin like this on purpose, so this is a warning. A cue without hands says `hands: []`.
        """
        if not self.config.hands:
            return []
        problems = []
        dancer = self.config.dancer
        if dancer.interaction_iterations == 0:
            words = "The hands move nothing: interaction_iterations is 0."
            cure = f"Write {max(dancer.coding_iterations - 1, 1)}, or remove the hands."
            problems.append(self.file.problem(("dancer", "interaction_iterations"), words, cure))
        for place, cue in enumerate(self.config.cues):
            if cue.iterations is not None and cue.iterations[1] == 0 and cue.hands != []:
                words = (
                    f"The hands move nothing in the cue '{cue.name}': none of its iterations is interactive."
                )
                coding = cue.iterations[0]
                cure = f"Write [{coding}, {max(coding - 1, 1)}], or `hands: []` where they are to let go."
                problems.append(self.file.problem(("cues", place, "iterations"), words, cure))
        return problems


def load_show(directory: Path | str) -> Show:
    """Read a show bundle: show.yaml and skeleton.bvh; network and phrase are only known to be there.

    Raises ConfigError with file, line, what is wrong and what to do, for all that is wrong at once.
    """
    directory = Path(directory)
    if not directory.is_dir():
        raise ConfigError(
            [Problem(directory, 0, "There is no such show folder.", "Check the path of the show.")]
        )
    file = read_yaml(directory / "show.yaml", directory)
    skeleton, problems = _skeleton(directory / "skeleton.bvh")
    context = {"directory": directory, "joints": skeleton.names if skeleton else None}
    try:
        config = validated(ShowConfig, file, context)
    except ConfigError as error:
        problems.extend(error.problems)
    else:
        problems.extend(cue_problems(config.cues, config.names, file))
    if problems or skeleton is None:
        raise ConfigError(problems)
    return Show(config, directory, skeleton, file)


def _skeleton(path: Path) -> tuple[Skeleton | None, list[Problem]]:
    cure = COPY_AGAIN
    try:
        require_inside(path, path.parent)
        return read_bvh(path).skeleton, []
    except BvhError as error:
        return None, [Problem(path, error.line, str(error).split(": ", 1)[-1], cure)]
    except OSError as error:
        return None, [Problem(path, 0, f"The skeleton cannot be read ({error.strerror}).", cure)]
