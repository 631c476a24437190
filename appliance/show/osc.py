"""box.yaml's OSC receivers: where joints go, and how the program that hears them wants them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from appliance.show.config_error import Problem
from appliance.show.posistagenet import unknown_joints
from appliance.show.section import MOST_PUPPETS, Axes, Ipv4, Section, key, refusal, refuse_repeats
from appliance.show.yaml_file import YamlFile

Dialect = Literal["ai-toolbox", "joint", "vmc", "features"]
Message = Literal[
    "pos_local",
    "pos_world",
    "rot_local",
    "rot_world",
    "rot",
    "lin_vel",
    "lin_acc",
    "lin_jerk",
    "rot_vel",
    "rot_acc",
    "ang_jerk",
]
Program = Literal[
    "mocap-analysis",
    "clustering",
    "classifier",
    "vae-rnn",
    "rnn",
    "motion2audio",
    "ray-marching",
    "supercollider",
]
Prefix = Annotated[str, Field(pattern=r"^(/[A-Za-z0-9_.-]+)+$")]

_Z_UP = ("z", "x", "y")  # the front along x, height along z, as his motion capture has them
_LIVE_MOCAP: Mapping[str, Any] = {"port": 9007, "messages": ["rot_local"], "ends": True}
PROGRAMS: Mapping[str, Mapping[str, Any]] = {
    "mocap-analysis": {"port": 9007, "messages": ["pos_world"], "scale": 100.0},
    "clustering": {"port": 9007, "messages": ["rot_local", "rot_world", "pos_world"], "scale": 100.0},
    "classifier": {"port": 9007, "messages": ["pos_local", "rot_local"], "scale": 100.0},
    "vae-rnn": _LIVE_MOCAP,
    "rnn": _LIVE_MOCAP,
    "motion2audio": _LIVE_MOCAP,
    "ray-marching": {"port": 9004, "messages": ["pos_world", "rot_world"], "scale": 100.0, "axes": _Z_UP},
    "supercollider": {
        "port": 9005,
        "messages": ["pos_world", "rot", "rot_acc", "lin_acc", "ang_jerk"],
        "prefix": "/mocap/joint",
        "axes": _Z_UP,
    },
}
_NUMBER = re.compile(r"(?<=/)\d+(?=/|$)")
_OF_ONE_DIALECT = ("messages", "prefix", "joints", "ends", "scale", "axes", "rotations")


class OscConfig(Section):
    """One receiver of the dancer's joints."""

    host: Ipv4 = key("The receiver's IP address.", "127.0.0.1")
    port: int = key("The receiver's UDP port; VMC: usually 39539.", 9004, within=(1, 65535))
    program: Program | None = key(
        "The AI-Toolbox program that listens: sets port and the keys below to its defaults; a key that "
        "you also write here takes precedence. docs/osc.md has the table.",
        None,
    )
    puppet: int | None = key(
        "In a show with several puppets: the number of the one that it gets, from 0, as if there were no "
        "other. null: all of them, numbered in the addresses; vmc: the first.",
        None,
        within=(0, MOST_PUPPETS - 1),
    )
    dialect: Dialect = key("The messages that it understands; docs/osc.md shows them.", "ai-toolbox")
    frame_message: bool = key("Send /bunraku/frame (tick, time, sequence, late) before the joints.", False)
    messages: list[Message] = key(
        "ai-toolbox: the lists it gets, in this order.",
        ["rot_local", "pos_world", "rot_world"],
        length=(1, 11),
    )
    prefix: Prefix = key(
        "ai-toolbox, features: the address before a list's name; /mocap/joint for older programs, "
        "/mocap/1/joint for a second dancer.",
        "/mocap/0/joint",
    )
    joints: list[str] = key(
        "ai-toolbox: the joints of each list, in this order; [] for all of the show.", [], length=(0, 256)
    )
    ends: bool = key(
        "ai-toolbox: count the ends of bones as joints, each after its joint, as BVH loaders do.", False
    )
    scale: float = key(
        "ai-toolbox: the receiver's units in a metre; 100: centimetres.", 1.0, within=(0.001, 1000)
    )
    axes: Axes = key(
        "ai-toolbox: which of the box's axes (right-handed, Y up) become the receiver's x, y and z; "
        "[z, x, y] for Z up.",
        ("x", "y", "z"),
    )
    rotations: Literal["quaternion", "euler"] = key(
        "ai-toolbox: w, x, y, z of a unit quaternion; or degrees about x, then y, then z (fixed axes).",
        "quaternion",
    )

    @model_validator(mode="before")
    @classmethod
    def _as_its_program_wants(cls, values: Any) -> Any:
        wanted = PROGRAMS.get(str(values.get("program"))) if isinstance(values, dict) else None
        return values if wanted is None else {**wanted, **values}

    @field_validator("messages", "joints")
    @classmethod
    def _each_once(cls, names: list[str]) -> list[str]:
        refuse_repeats(names, "'{value}' is listed twice.", "Remove one.")
        return names

    @model_validator(mode="after")
    def _keys_of_its_dialect(self) -> OscConfig:
        if self.dialect != "ai-toolbox":
            shared = ("prefix",) if self.dialect == "features" else ()
            foreign = [
                name for name in _OF_ONE_DIALECT if name in self.model_fields_set and name not in shared
            ]
            if self.program is not None or foreign:
                name = "program" if self.program is not None else foreign[0]
                raise refusal(
                    f"'{name}' belongs to the dialect ai-toolbox, and this receiver gets {self.dialect}.",
                    "Remove it, or write `dialect: ai-toolbox`.",
                    at=name,
                )
        return self

    def number_of(self, puppet: int) -> int:
        """The number of a puppet in this receiver's addresses."""
        return puppet if self.puppet is None else 0

    def of_puppet(self, puppet: int) -> OscConfig | None:
        """This receiver with the prefix of a puppet; None where it gets nothing of it.

        A prefix without a number, like /mocap/joint, has room for one puppet.
        """
        number = self.number_of(puppet)
        if self.puppet not in (None, puppet) or (number and self.dialect == "vmc"):
            return None
        if not number or self.dialect == "joint":
            return self
        prefix = _NUMBER.sub(lambda found: str(int(found[0]) + number), self.prefix, count=1)
        return None if prefix == self.prefix else self.model_copy(update={"prefix": prefix})


def osc_misfits(
    receivers: Sequence[OscConfig], joints: Sequence[str], puppets: int, file: YamlFile
) -> list[Problem]:
    """Joints that a skeleton with these `joints` does not have, and puppets that the show does not; file: the
    box file of the receivers."""
    missing = [
        file.problem(
            ("outputs", "osc", place, "puppet"),
            f"The show has no puppet {receiver.puppet}: this receiver would get nothing.",
            f"Write 0 to {puppets - 1}, or null for all." if puppets > 1 else "Remove it.",
        )
        for place, receiver in enumerate(receivers)
        if (receiver.puppet or 0) >= puppets
    ]
    return missing + [
        problem
        for place, receiver in enumerate(receivers)
        for problem in unknown_joints(receiver.joints, joints, ("outputs", "osc", place), file)
    ]
