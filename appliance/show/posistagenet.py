"""box.yaml's PosiStageNet outputs: which joints travel as trackers, where to, in whose axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator

from appliance.show.config_error import Problem, did_you_mean
from appliance.show.section import Ipv4, Section, refusal
from appliance.show.yaml_file import Location, YamlFile, read_yaml

LAST_TRACKER = 65535

Direction = Literal["x", "-x", "y", "-y", "z", "-z"]
Axes = Annotated[tuple[Direction, Direction, Direction], Field(strict=False)]
Offset = Annotated[tuple[float, float, float], Field(strict=False)]


class PosiStageNetConfig(Section):
    """Positions of joints for media servers and followspots, as PosiStageNet trackers."""

    host: Ipv4 = Field(
        default="236.10.10.10",
        description="Where to: the protocol's multicast group, or the address of one receiver.",
    )
    port: int = Field(default=56565, ge=1, le=65535, description="UDP port.")
    interface: Ipv4 = Field(
        default="127.0.0.1",
        description="Address of the box's own network interface that multicast leaves by; with 127.0.0.1 "
        "nothing leaves the machine.",
    )
    system_name: str = Field(
        default="Bunraku", min_length=1, max_length=64, description="What receivers call the box."
    )
    joints: list[str] = Field(
        default_factory=list,
        max_length=256,
        description="Joints that become trackers, in this order; [] for all of the show.",
    )
    first_tracker: int = Field(
        default=0,
        ge=0,
        le=LAST_TRACKER,
        description="Number of the first joint's tracker; the next ones follow. Two boxes in one network "
        "need numbers of their own. Some consoles count trackers from 1.",
    )
    every: int = Field(
        default=1, ge=1, le=50, description="Send each n-th frame: 1 is 50 a second, 2 is 25 a second."
    )
    speed: bool = Field(default=False, description="Send speeds (metres a second) beside the positions.")
    axes: Axes = Field(
        default=("x", "y", "z"),
        description="Which of the box's axes (right-handed, Y up) become the receiver's x, y and z; "
        "[x, -z, y] for a receiver with Z up.",
    )
    scale: float = Field(default=1.0, ge=0.001, le=1000, description="The receiver's units in a metre.")
    offset: Offset = Field(
        default=(0.0, 0.0, 0.0), description="Added at the end, in the receiver's axes and units."
    )

    @field_validator("joints")
    @classmethod
    def _each_joint_once(cls, joints: list[str]) -> list[str]:
        for place, joint in enumerate(joints):
            if joint in joints[:place]:
                raise refusal(f"The joint '{joint}' stands here twice.", "Remove one.", at=place)
        return joints

    @field_validator("axes")
    @classmethod
    def _each_axis_once(cls, axes: tuple[Direction, Direction, Direction]) -> tuple[Direction, ...]:
        if sorted(axis[-1] for axis in axes) != ["x", "y", "z"]:
            raise refusal("Each of x, y and z is needed once.", "Write for instance [x, -z, y].")
        return axes


def misfits(
    outputs: Sequence[PosiStageNetConfig], joints: Sequence[str], box_file: Path | None
) -> list[Problem]:
    """What does not fit a skeleton with these joints; `box_file`: where the outputs come from."""
    file = YamlFile(Path("box.yaml")) if box_file is None else read_yaml(box_file)
    problems = []
    for place, output in enumerate(outputs):
        here: Location = ("outputs", "posistagenet", place)
        for number, joint in enumerate(output.joints):
            if joint not in joints:
                message = f"The show's skeleton has no joint '{joint}'."
                line = file.line((*here, "joints", number))
                problems.append(Problem(file.path, line, message, did_you_mean(joint, joints)))
        last = output.first_tracker + len(output.joints or joints) - 1
        if last > LAST_TRACKER:
            message = f"Trackers are numbered up to {LAST_TRACKER}, and these would end at {last}."
            line = file.line((*here, "first_tracker"))
            problems.append(
                Problem(file.path, line, message, "Begin with a lower number, or name fewer joints.")
            )
    return problems
