"""Dancers in fifteen conventions: names, units, axes, zero poses and rates, as their systems have them.

Everything here is made by this script after the systems' documentation; nothing is a recording of anybody.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from tests.pose.other_frames import axes_turned, rezeroed, scaled

# role, role of its parent, metres in a T-pose that faces +z
Bone = tuple[str, str, tuple[float, float, float]]

_TRUNK: list[Bone] = [
    ("hips", "", (0, 0, 0)),
    ("spine", "hips", (0, 0.10, 0)),
    ("chest", "spine", (0, 0.22, 0)),
    ("neck", "chest", (0, 0.20, 0)),
    ("head", "neck", (0, 0.10, 0.01)),
]
_SIDE: list[Bone] = [
    ("collar", "chest", (0.03, 0.15, 0)),
    ("upper arm", "collar", (0.14, 0, 0)),
    ("forearm", "upper arm", (0.28, 0, 0)),
    ("hand", "forearm", (0.26, 0, 0)),
    ("thigh", "hips", (0.10, -0.04, 0)),
    ("shin", "thigh", (0, -0.43, 0)),
    ("foot", "shin", (0, -0.41, 0)),
    ("toe", "foot", (0, -0.07, 0.14)),
]
_MIDDLE, _PARTS = [bone[0] for bone in _TRUNK], [bone[0] for bone in _SIDE]
_ENDS = {"head": (0.0, 0.2, 0.0), "toe": (0.0, 0.0, 0.06)}
_PHALANXES = ("Proximal", "Intermediate", "Distal")
_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")  # across the palm, from the front to the back
_FINGERTIPS = {f"{finger} 3": (0.02, 0.0, 0.0) for finger in _FINGERS}


@dataclass(frozen=True)
class Convention:
    """How a system writes a dancer. names: of hips, spine, chest, neck, head, then of a side's eight joints.

    between: of the joints between spine and chest; side: a pattern of `word` and of `side`, one of the two in
    `sides`; finger: the word of a finger's joint, as a pattern of `finger` or its `place`, of `number` or
    `bone`, '' without fingers; metres: in a unit of length; up: the vertical axis; turned_degrees: how far
    the dancer is turned from +z about the vertical; zero: what the zero pose is (T, A, or x: all bones along
    x); floor_root: the name of a root on the floor, '' without.
    """

    names: str
    between: str = ""
    sides: tuple[str, str] = ("Left", "Right")
    side: str = "{side}{word}"
    prefix: str = ""
    finger: str = ""
    metres: float = 0.01
    up: str = "y"
    turned_degrees: float = 0.0
    zero: str = "T"
    floor_root: str = ""
    fps: float = 60.0

    def name(self, role: str) -> str:
        words = self.names.split()
        side, _, part = role.partition(" ")
        if side == "between":
            return self.prefix + self.between.split()[int(part)]
        if side not in ("left", "right"):
            return self.prefix + words[_MIDDLE.index(role)]
        finger, _, number = part.partition(" ")
        if finger in _FINGERS:
            place, bone = 1 + _FINGERS.index(finger), _PHALANXES[int(number) - 1]
            word = self.finger.format(finger=finger, place=place, number=number, bone=bone)
        else:
            word = words[len(_MIDDLE) + _PARTS.index(part)]
        return self.prefix + self.side.format(word=word, side=self.sides[side == "right"])

    def roles(self) -> dict[str, str]:
        """Role to name, without fingers and what lies between spine and chest."""
        sides = [f"{side} {part}" for side in ("left", "right") for part in _PARTS]
        return {role: self.name(role) for role in (*_MIDDLE, *sides)}

    def bones(self) -> list[Bone]:
        """The whole body in the order of a BVH file."""
        between = [f"between {number}" for number in range(len(self.between.split()))]
        spine = ["spine", *between, "chest"]
        found = [bone for bone in _TRUNK if bone[0] != "chest"]
        found += [(above, below, (0.0, 0.22 / (len(spine) - 1), 0.0)) for below, above in pairwise(spine)]
        for side, sign in (("left", 1), ("right", -1)):
            parts = _SIDE + (_fingers() if self.finger else [])
            found += [
                (f"{side} {role}", above if above in _MIDDLE else f"{side} {above}", (sign * x, y, z))
                for role, above, (x, y, z) in parts
            ]
        return _depth_first(found)


_MOTIONBUILDER = "Hips Spine Spine1 Neck Head Shoulder Arm ForeArm Hand UpLeg Leg Foot ToeBase"
CONVENTIONS = {
    "Rokoko": Convention(
        "Hips Spine1 Spine4 Neck Head Shoulder Arm ForeArm Hand Thigh Shin Foot Toe",
        between="Spine2 Spine3",
        finger="Finger{place}{bone}",
        fps=100.0,
    ),
    "Xsens": Convention(
        "Hips Chest Chest4 Neck Head Collar Shoulder Elbow Wrist Hip Knee Ankle Toe",
        between="Chest2 Chest3",
        fps=240.0,
    ),
    "Captury": Convention(
        _MOTIONBUILDER.replace("Spine1", "Spine4"),
        between="Spine1 Spine2 Spine3",
        finger="Hand{finger}{number}",
        metres=0.001,
        floor_root="Root",
        fps=50.0,
    ),
    "OptiTrack": Convention(
        "Hips Ab Chest Neck Head Shoulder UArm FArm Hand Thigh Shin Foot Toe",
        sides=("L", "R"),
        prefix="Skeleton 001:",
        finger="{finger}{number}",
        metres=1.0,
        fps=120.0,
    ),
    "Mixamo": Convention(
        _MOTIONBUILDER.replace("Spine1", "Spine2"),
        between="Spine1",
        prefix="mixamorig:",
        finger="Hand{finger}{number}",
        fps=30.0,
    ),
    "Unreal": Convention(
        "pelvis spine_01 spine_03 neck_01 head clavicle upperarm lowerarm hand thigh calf foot ball",
        sides=("l", "r"),
        side="{word}_{side}",
        between="spine_02",
        finger="{finger}_0{number}",
        up="z",
        floor_root="root",
        zero="A",
    ),
    "Unity": Convention(
        "Hips Spine Chest Neck Head Shoulder UpperArm LowerArm Hand UpperLeg LowerLeg Foot Toes",
        side="{word}_{side}",
        sides=("L", "R"),
        finger="{finger}{bone}",
        metres=1.0,
        turned_degrees=180.0,
    ),
    "Vicon": Convention(
        "Pelvis Abdomen Thorax Neck Head Clavicle Humerus Radius Hand Femur Tibia Foot Toes",
        sides=("L", "R"),
        metres=0.001,
        up="z",
        turned_degrees=90.0,
        fps=100.0,
    ),
    "SMPL": Convention(
        "Pelvis Spine1 Spine3 Neck Head Collar Shoulder Elbow Wrist Hip Knee Ankle Foot",
        sides=("L", "R"),
        side="{side}_{word}",
        between="Spine2",
        metres=1.0,
        fps=30.0,
    ),
    "CMU": Convention(_MOTIONBUILDER, metres=0.0564, fps=120.0),
    "LAFAN": Convention(
        _MOTIONBUILDER.replace("ToeBase", "Toe").replace("Spine1", "Spine2"),
        between="Spine1",
        zero="x",
        fps=30.0,
    ),
    "mocopi": Convention(
        "root torso_1 torso_7 neck_1 head shoulder up_arm low_arm hand up_leg low_leg foot toes",
        sides=("l", "r"),
        side="{side}_{word}",
        between="torso_2 torso_3 torso_4 torso_5 torso_6",
        fps=50.0,
    ),
    "Second Life": Convention(
        "Pelvis Torso Chest Neck Head Collar Shoulder Elbow Wrist Hip Knee Ankle Foot",
        side="{word}{side}",
        prefix="m",
        metres=1.0,
        fps=30.0,
    ),
    "MMD": Convention(
        "腰 上半身 上半身2 首 頭 肩 腕 ひじ 手首 足 ひざ 足首 つま先",
        sides=("左", "右"),
        metres=0.1,
        fps=30.0,
    ),
    "joint_Root": Convention(
        "HipMaster TorsoA TorsoC Neck Head Clavicle Shoulder Elbow Hand Hip Knee Foot Toe",
        sides=("LT", "RT"),
        side="{word}{side}",
        between="TorsoB",
        prefix="joint_",
        floor_root="joint_Root",
        fps=30.0,
    ),
}


def _fingers() -> list[Bone]:
    """Of one hand: three joints each, as in a T-pose with the palms to the floor."""
    return [
        (f"{finger} {n}", f"{finger} {n - 1}" if n > 1 else "hand", (0.03 if n > 1 else 0.085, 0, across))
        for place, finger in enumerate(_FINGERS)
        for n, across in ((1, 0.03 - 0.02 * place), (2, 0.0), (3, 0.0))
    ]


def _depth_first(given: list[Bone], above: str = "") -> list[Bone]:
    return [part for bone in given if bone[1] == above for part in (bone, *_depth_first(given, bone[0]))]


def skeleton_of(convention: str) -> Skeleton:
    """The skeleton in metres, Y up, facing +z, its zero pose a T, with the convention's names and root."""
    system = CONVENTIONS[convention]
    whole = system.bones()
    names = [system.name(role) for role, _, _ in whole]
    order = [role for role, _, _ in whole]
    parents = [order.index(above) if above else -1 for _, above, _ in whole]
    offsets = [offset for _, _, offset in whole]
    tips = _ENDS | (_FINGERTIPS if system.finger else {"hand": (0.17, 0.0, 0.0)})
    ends = []
    for joint, role in enumerate(order):
        if tip := tips.get(role.removeprefix("left ").removeprefix("right ")):
            sign = -1.0 if role.startswith("right") else 1.0
            ends.append((joint, (sign * tip[0], tip[1], tip[2])))
    if system.floor_root:
        names, parents = [system.floor_root, *names], [-1, *(parent + 1 for parent in parents)]
        offsets, ends = [(0, 0, 0), *offsets], [(joint + 1, tip) for joint, tip in ends]
    return Skeleton(tuple(names), tuple(parents), np.array(offsets, float), tuple(ends))


def dance_of(convention: str, seconds: float = 12.0, fps: float = 50.0, seed: int = 0) -> Recording:
    """A dance in metres, Y up, to the audience: arms that hang and swing, knees that bend, a body that sways.

    A root on the floor follows the hips over it.
    """
    skeleton, time = skeleton_of(convention), np.arange(round(seconds * fps)) / fps
    rng = np.random.default_rng(seed)
    system = CONVENTIONS[convention]
    poses = np.tile(quaternion.IDENTITY.astype(float), (len(time), len(skeleton), 1))

    def swing(size: float) -> Array:
        slow = np.minimum(time / 2.0, 1.0)  # the dancer begins standing
        return size * slow * np.sin(time * rng.uniform(1.5, 4.0) + rng.uniform(0, 6))

    for role in system.roles():
        joint = skeleton.index(system.name(role))
        part = role.rpartition(" ")[2] if role.startswith(("left", "right")) else role
        axis = rng.normal(size=3)
        turn = quaternion.from_axis_angle(axis, swing(0.05 if part in ("hips", "foot") else 0.25))
        if role.endswith("upper arm"):
            hanging = np.radians(-75.0 if role.startswith("left") else 75.0)
            turn = quaternion.multiply(quaternion.from_axis_angle([0.0, 0.0, 1.0], hanging), turn)
        if part in ("thigh", "shin"):
            turn = quaternion.from_axis_angle([1.0, 0.0, 0.0], swing(0.12))
        poses[:, joint] = turn
    hips = np.stack([0.3 * np.sin(time), np.full(len(time), 0.95), 0.2 * np.cos(time)], axis=-1)
    hips_joint = skeleton.index(system.name("hips"))
    flat, _ = skeleton.forward_kinematics(poses, np.zeros((len(time), 3)))
    feet = [j for foot in skeleton.feet for j in skeleton.descendants(foot)]
    hips[:, 1] = 0.005 - (flat[:, feet, 1] - flat[:, [hips_joint], 1]).min(axis=1)
    if hips_joint == 0:
        return Recording(skeleton, quaternion.continuous(poses), hips, fps)
    places = np.tile(skeleton.offsets, (len(time), 1, 1))
    floor = hips * [1.0, 0.0, 1.0]
    places[:, hips_joint] = hips - floor
    return Recording(skeleton, quaternion.continuous(poses), floor, fps, places)


def as_the_system_writes(dance: Recording, convention: str) -> Recording:
    """The same dance in the system's zero pose, axes and units, as if read in centimetres."""
    system = CONVENTIONS[convention]
    given = rezeroed(dance, _zero_world(dance.skeleton, convention))
    turn = quaternion.from_axis_angle([0.0, 1.0, 0.0], np.radians(system.turned_degrees))
    if system.up == "z":
        turn = quaternion.multiply(quaternion.from_axis_angle([1.0, 0.0, 0.0], np.pi / 2), turn)
    return scaled(axes_turned(given, turn), 0.01 / system.metres)


def _zero_world(skeleton: Skeleton, convention: str) -> Array:
    """World rotations (J, 4) from the T-pose to the system's zero pose."""
    zero = np.tile(quaternion.IDENTITY.astype(float), (len(skeleton), 1))
    kind = CONVENTIONS[convention].zero
    for joint in range(len(skeleton)):
        role = next((r for r, j in skeleton.roles.items() if j == joint), "")
        if kind == "A" and role.endswith("upper arm"):
            angle = np.radians(-45.0 if role.startswith("left") else 45.0)
            zero[joint] = quaternion.from_axis_angle([0.0, 0.0, 1.0], angle)
        elif kind == "A" and joint:
            zero[joint] = zero[skeleton.parents[joint]]
        if kind == "x":
            children = [c for c, parent in enumerate(skeleton.parents) if parent == joint]
            tips = [end for j, end in skeleton.ends if j == joint] or [(0.0, 1.0, 0.0)]
            bone = skeleton.offsets[children[0]] if len(children) == 1 else tips[0]
            zero[joint] = _turn_to_x(np.asarray(bone, float))
    return zero


def _turn_to_x(bone: Array) -> Array:
    direction = bone / np.linalg.norm(bone)
    axis, cosine = np.cross(direction, [1.0, 0.0, 0.0]), float(direction[0])
    if np.linalg.norm(axis) < 1e-9:
        axis = np.array([0.0, 1.0, 0.0])
    return quaternion.from_axis_angle(axis, np.arccos(np.clip(cosine, -1.0, 1.0)))
