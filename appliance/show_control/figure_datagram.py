"""Whole figures in the binary datagrams of Xsens MVN (MXTP02) and of Sony's mocopi, as turns of bones."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.pose.possible import FARTHEST_M
from appliance.pose.turns import UNTURNED, Quaternion, Vector, multiplied
from appliance.sensor.foreign.mocopi import MOCOPI_PARENTS, mocopi_messages
from appliance.show.programs import MOCOPI_BONES
from appliance.show_control.figure_pose import HIPS

# MVN's real-time network streaming protocol: a head of 24 bytes, then 32 bytes for each segment, big-endian.
MVN = b"MXTP02"
# Its id, sample, part, items, time, person; body, props, fingers, reserved, size.
_MVN_HEAD = struct.Struct(">6sIBBIBBBBHH")
_MVN_SEGMENT = struct.Struct(">i7f")  # number from 1, x, y, z in metres, w, x, y, z; Z is up, X to the front
_MVN_BONES = (
    (1, HIPS), (3, "Spine"), (4, "Chest"), (5, "UpperChest"), (6, "Neck"), (7, "Head"),
    *((first + place, f"{side}{part}") for first, side in ((8, "Right"), (12, "Left"))
      for place, part in enumerate(("Shoulder", "UpperArm", "LowerArm", "Hand"))),
    *((first + place, f"{side}{part}") for first, side in ((16, "Right"), (20, "Left"))
      for place, part in enumerate(("UpperLeg", "LowerLeg", "Foot", "Toes"))),
)  # fmt: skip
_BONE_OF_SEGMENT = dict(_MVN_BONES)
DATAGRAM = "mocap"  # stands for an OSC address where one of these datagrams is handed on
_MOCOPI = b"head"  # the name of its first chunk, behind four bytes of length
_BONE_OF_MOCOPI = {
    **{MOCOPI_BONES[joint]: bone for bone, joint in humanoid_bones(MOCOPI_BONES).items()},
    **dict.fromkeys(("torso_1", "torso_2"), ""),
    "torso_3": "Spine",
    "torso_5": "Chest",
    "torso_7": "UpperChest",
}
_UNIT = 0.1  # a rotation this far from unit length is invalid


class Figure(NamedTuple):
    """turns: Unity's bones in the room from a T-pose, in the box's axes; hips: their place in metres."""

    program: str
    turns: dict[str, Quaternion]
    hips: Vector


def is_figure(received: bytes) -> bool:
    """Whether a datagram is one of these, and no OSC."""
    return received.startswith(b"MXTP") or (received[4:8] == _MOCOPI and received[:1] != b"/")


def turns_in(received: bytes) -> Figure | None:
    """The figure of a datagram; None: it holds none, or not the first person. Raises ValueError with one
    clear sentence.
    """
    return _of_mvn(received) if received.startswith(b"MXTP") else _of_mocopi(received)


def _of_mvn(received: bytes) -> Figure | None:
    if not received.startswith(MVN):
        return None  # names, scales, other numbers
    if len(received) < _MVN_HEAD.size:
        raise ValueError("This is no whole datagram of Xsens MVN.")
    _, _, _, items, _, character, *_ = _MVN_HEAD.unpack_from(received)
    if character:
        return None  # the first person only
    if len(received) < _MVN_HEAD.size + items * _MVN_SEGMENT.size:
        raise ValueError("This is no whole datagram of Xsens MVN.")
    turns: dict[str, Quaternion] = {}
    hips: Vector = (math.nan,) * 3
    for item in range(items):
        number, *values = _MVN_SEGMENT.unpack_from(received, _MVN_HEAD.size + item * _MVN_SEGMENT.size)
        bone = _BONE_OF_SEGMENT.get(number)
        if bone is None:
            continue
        x, y, z, w, turn_x, turn_y, turn_z = values
        turns[bone] = _unit("Xsens MVN", bone, (w, turn_y, turn_z, turn_x))
        if bone == HIPS:
            hips = _place("Xsens MVN", (y, z, x))
    return Figure("Xsens MVN", turns, hips) if turns else None


def _of_mocopi(received: bytes) -> Figure | None:
    room: dict[str, Quaternion] = {}
    turns: dict[str, Quaternion] = {}
    hips: Vector = (math.nan,) * 3
    for _, arguments in mocopi_messages(received):
        name = str(arguments[0])
        x, y, z, turn_x, turn_y, turn_z, w = (one for one in arguments[1:] if isinstance(one, float))
        turned = _unit("mocopi", name, (w, turn_x, turn_y, turn_z))
        room[name] = multiplied(room.get(MOCOPI_PARENTS.get(name, ""), UNTURNED), turned)
        if bone := _BONE_OF_MOCOPI.get(name):
            turns[bone] = room[name]
        if bone == HIPS:
            hips = _place("mocopi", (x, y, z))
    return Figure("mocopi", turns, hips) if turns else None


def _unit(program: str, bone: str, turn: Quaternion) -> Quaternion:
    length = math.hypot(*turn)
    if not abs(length - 1.0) < _UNIT:
        raise ValueError(f"{program} {bone}: a rotation has the length 1, and {length:.3g} came.")
    w, x, y, z = turn
    return w / length, x / length, y / length, z / length


def _place(program: str, place: Vector) -> Vector:
    if not all(abs(one) <= FARTHEST_M for one in place):
        raise ValueError(f"{program}: no place is farther than {FARTHEST_M:g} m from the middle.")
    return place
