"""box.yaml's foreign sensors: phones and programs that take a wearable's place."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from appliance.show.config_error import did_you_mean
from appliance.show.control import Senders
from appliance.show.hand import LONGEST_SENSOR_NAME
from appliance.show.programs import MOCOPI_BONES, PROGRAMS, Program
from appliance.show.section import Direction, Ipv4, Section, key, refusal

MOST = 16


class ForeignSensorConfig(Section):
    """A phone or a program in place of a wearable."""

    name: str = key("Its name, as a hand of the show has it under `sensor`.", length=(1, LONGEST_SENSOR_NAME))
    from_: Literal["phone", "osc", "gyrosc", "zigsim", "x-imu3", "vmc", "slimevr", "mocopi"] = Field(
        alias="from",
        description="Where its orientation comes from: a phone by the page of this box; OSC of any program, "
        "or of GyrOSC, ZIG SIM, x-IMU3; a bone or tracker of VMC, of SlimeVR or of mocopi.",
    )
    host: Ipv4 = key("Address where the program's datagrams arrive.", "127.0.0.1")
    port: int | None = key(
        "UDP port where they arrive; several sensors may share it. null: 39539 for vmc and slimevr, 12351 "
        "for mocopi, 9760 for the others.",
        None,
        within=(1, 65535),
    )
    senders: list[Senders] = key(
        "Addresses or networks that the program may send from. This machine always may.", [], length=(0, 32)
    )
    address: str | None = key(
        "OSC address of the orientation; `*` and `?` stand for any letters.", None, length=(2, 200)
    )
    values: Literal["xyzw", "wxyz", "euler", "matrix"] | None = key(
        "Meaning of the numbers: a quaternion in this order, degrees about x, y and z (z is turned first), "
        "or a rotation matrix row by row. null: as the program sends.",
        None,
    )
    axes: Literal["z-up", "y-up", "unity"] | None = key(
        "The program's axes: right-handed with z or y up, or those of Unity. null: the program's.", None
    )
    facing: Direction | None = key(
        "The axis of the sensor that points to the front in the neutral pose, in the program's axes. null: x "
        "for z-up, z for the others.",
        None,
    )
    drifts: bool = key(
        "false for optical and magnetic trackers, whose heading does not drift: it is never corrected. "
        "Inertial ones drift, a phone, SlimeVR and mocopi among them.",
        True,
    )
    bone: str | None = key("Bone or tracker, like LeftLowerArm or l_low_arm.", None, length=(1, 64))

    @property
    def program(self) -> Program | None:
        """The program; None: a phone."""
        return PROGRAMS.get(self.from_)

    @property
    def usual_port(self) -> int:
        """The port where its datagrams arrive."""
        return self.port or (self.program.port if self.program is not None else 0)

    @model_validator(mode="after")
    def _of_use(self) -> ForeignSensorConfig:
        program = self.program
        has_bones = program is not None and program.has_bones
        useless = ["host", "port", "senders", "axes", "facing", "drifts"] if program is None else []
        useless += ["address", "values"] if program is None or has_bones else []
        useless += [] if has_bones else ["bone"]
        for name in useless:
            if name in self.model_fields_set:
                raise refusal(
                    f"`{name}` does nothing for a sensor from {self.from_}.", "Remove this line.", at=name
                )
        if has_bones and self.bone is None:
            raise refusal(
                f"A sensor from {self.from_} is one bone.", "Write `bone: LeftLowerArm`.", at="from"
            )
        if self.from_ == "mocopi" and self.bone is not None and self.bone.lower() not in MOCOPI_BONES:
            cure = did_you_mean(self.bone, MOCOPI_BONES)
            raise refusal(f"mocopi has no bone '{self.bone}'.", cure, at="bone")
        if program is not None and not has_bones and not (self.address or program.address):
            raise refusal("An address is needed.", "Write `address: /quaternion`.", at="from")
        if self.address is not None and not self.address.startswith(("/", "*")):
            raise refusal(f"'{self.address}' is no address of OSC.", "It begins with /.", at="address")
        if program is not None and not self.host.startswith("127.") and not self.senders:
            raise refusal(
                f"Datagrams are heard on {self.host}, but no sender is listed.",
                "List the machine that the program runs on: `senders: [192.168.0.20]`.",
                at="host",
            )
        if self.host.startswith("127.") and any(not one.startswith("127.") for one in self.senders):
            raise refusal(
                f"{self.senders[0].removesuffix('/32')} may send, but datagrams are heard on {self.host}: "
                "from this machine only.",
                "Write `host: 0.0.0.0` beside `senders`.",
                at="senders",
            )
        return self
