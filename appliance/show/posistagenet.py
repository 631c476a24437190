"""box.yaml's PosiStageNet outputs: which joints travel as trackers, where to, in which axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field, field_validator

from appliance.show.config_error import Problem, did_you_mean
from appliance.show.section import Axes, Ipv4, Section, key, refuse_repeats
from appliance.show.yaml_file import Location, YamlFile

LAST_TRACKER = 65535

Offset = Annotated[tuple[float, float, float], Field(strict=False)]


class PosiStageNetConfig(Section):
    """Positions of joints for media servers and followspots, as PosiStageNet trackers."""

    host: Ipv4 = key(
        "Destination: the protocol's multicast group, or the address of one receiver.", "236.10.10.10"
    )
    port: int = key("UDP port.", 56565, within=(1, 65535))
    interface: Ipv4 = key(
        "Address of the box's network interface for multicast; with 127.0.0.1 nothing leaves the machine.",
        "127.0.0.1",
    )
    system_name: str = key("Name of the box for receivers.", "Bunraku", length=(1, 64))
    joints: list[str] = key(
        "Joints that become trackers, in this order; [] for all of the show.", [], length=(0, 256)
    )
    first_tracker: int = key(
        "Number of the first joint's tracker; the next ones follow, then those of the next puppet. Two "
        "boxes in one network need different numbers. Some consoles count trackers from 1.",
        0,
        within=(0, LAST_TRACKER),
    )
    every: int = key("Send every n-th frame: 1 is 50 a second, 2 is 25 a second.", 1, within=(1, 50))
    speed: bool = key("Also send speeds (metres a second).", False)
    axes: Axes = key(
        "Which of the box's axes (right-handed, Y up) become the receiver's x, y and z; "
        "[x, -z, y] for a receiver with Z up.",
        ("x", "y", "z"),
    )
    scale: float = key("The receiver's units in a metre.", 1.0, within=(0.001, 1000))
    offset: Offset = key("Added at the end, in the receiver's axes and units.", (0.0, 0.0, 0.0))

    @field_validator("joints")
    @classmethod
    def _each_joint_once(cls, joints: list[str]) -> list[str]:
        refuse_repeats(joints, "The joint '{value}' is listed twice.", "Remove one.")
        return joints


def unknown_joints(
    named: Sequence[str], joints: Sequence[str], here: Location, file: YamlFile
) -> list[Problem]:
    """The joints that an output names under `joints` and a skeleton with `joints` lacks."""
    problems = []
    for number, joint in enumerate(named):
        if joint not in joints:
            message = f"The show's skeleton has no joint '{joint}'."
            problems.append(file.problem((*here, "joints", number), message, did_you_mean(joint, joints)))
    return problems


def misfits(
    outputs: Sequence[PosiStageNetConfig], joints: Sequence[str], puppets: int, file: YamlFile
) -> list[Problem]:
    """Faults of the outputs for this number of puppets with these joints. file: the box file with the
    outputs.
    """
    problems: list[Problem] = []
    for place, output in enumerate(outputs):
        here: Location = ("outputs", "posistagenet", place)
        problems += unknown_joints(output.joints, joints, here, file)
        last = output.first_tracker + puppets * len(output.joints or joints) - 1
        if last > LAST_TRACKER:
            message = f"Trackers are numbered up to {LAST_TRACKER}, and these would end at {last}."
            cure = "Begin with a lower number, or name fewer joints."
            problems.append(file.problem((*here, "first_tracker"), message, cure))
    return problems
