"""Programs that may send a foreign sensor's orientation: their usual ports, addresses, numbers and axes."""

from __future__ import annotations

from dataclasses import dataclass

PHONE = "phone"
MOCOPI_BONES = (
    *("root", *(f"torso_{number}" for number in range(1, 8)), "neck_1", "neck_2", "head"),
    *("l_shoulder", "l_up_arm", "l_low_arm", "l_hand"),
    *("r_shoulder", "r_up_arm", "r_low_arm", "r_hand"),
    *("l_up_leg", "l_low_leg", "l_foot", "l_toes"),
    *("r_up_leg", "r_low_leg", "r_foot", "r_toes"),
)


@dataclass(frozen=True)
class Program:
    """How a program sends: by bones of a figure, or by OSC with this address and these numbers.

    address: "" where every user chooses another one. values: xyzw, wxyz, euler, matrix.
    """

    port: int
    axes: str
    address: str = ""
    values: str = ""

    @property
    def has_bones(self) -> bool:
        """Whether it sends a figure's bones by name."""
        return not self.values


PROGRAMS = {
    "osc": Program(9760, "z-up", "", "xyzw"),
    "gyrosc": Program(9760, "z-up", "/gyrosc/quat", "wxyz"),
    "zigsim": Program(9760, "z-up", "*/quaternion", "xyzw"),
    "x-imu3": Program(9760, "z-up", "*/quaternion", "wxyz"),
    "vmc": Program(39539, "unity"),
    "slimevr": Program(39539, "unity"),
    "mocopi": Program(12351, "y-up"),
}
SOURCES = frozenset((PHONE, *PROGRAMS))  # `way` of a foreign sensor in the roster
