"""Skeletons of very different bodies, for tests of what must work with any of them."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np

from appliance.pose.bvh import read_bvh
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import default_show_path

Bone = tuple[str, str | None, tuple[float, float, float]]


def built(bones: list[Bone], ends: dict[str, tuple[float, float, float]] | None = None) -> Skeleton:
    """A skeleton of (name, parent, offset in metres) and the bones that end without a joint."""
    names = tuple(name for name, _, _ in bones)
    parents = tuple(-1 if parent is None else names.index(parent) for _, parent, _ in bones)
    tips = tuple((names.index(name), tip) for name, tip in (ends or {}).items())
    return Skeleton(names, parents, np.array([offset for _, _, offset in bones], float), tips)


@functools.cache
def dancer() -> Skeleton:
    """The 43 joints of the default show, with fingers."""
    return read_bvh(default_show_path() / "phrase.bvh", metres_per_unit=0.01).skeleton


def toy() -> Skeleton:
    """A chain of five joints."""
    return built(
        [("a", None, (0, 0, 0)), *((n, p, (0, 0.3, 0)) for n, p in zip("bcde", "abcd", strict=True))],
        {"e": (0, 0.2, 0)},
    )


def point() -> Skeleton:
    """One joint and nothing else: a thing that is carried about, or a file that is not what it should be."""
    return built([("thing", None, (0, 0, 0))])


def rope(joints: int) -> Skeleton:
    """A rope of three metres with so many joints."""
    long = 3.0 / joints
    bones: list[Bone] = [
        (f"j{n}", f"j{n - 1}" if n else None, (0, long if n else 0, 0)) for n in range(joints)
    ]
    return built(bones, {f"j{joints - 1}": (0, long, 0)})


def mixamo() -> Skeleton:
    """Named as by Mixamo, centimetre by centimetre symmetrical, without fingers."""
    bones: list[Bone] = [
        ("mixamorig:Hips", None, (0, 0, 0)),
        ("mixamorig:Spine", "mixamorig:Hips", (0, 0.10, -0.01)),
        ("mixamorig:Spine1", "mixamorig:Spine", (0, 0.12, 0)),
        ("mixamorig:Spine2", "mixamorig:Spine1", (0, 0.13, 0)),
        ("mixamorig:Neck", "mixamorig:Spine2", (0, 0.15, 0.01)),
        ("mixamorig:Head", "mixamorig:Neck", (0, 0.10, 0.02)),
    ]
    for side, sign in (("Left", 1), ("Right", -1)):
        arm = ["Shoulder", "Arm", "ForeArm", "Hand"]
        leg = ["UpLeg", "Leg", "Foot", "ToeBase"]
        arm_offsets = [(0.06, 0.10, 0), (0.13, 0, 0), (0.27, 0, 0), (0.26, 0, 0)]
        leg_offsets = [(0.09, -0.05, 0), (0, -0.42, 0), (0, -0.42, -0.02), (0, -0.08, 0.12)]
        for names, root, offsets in (
            (arm, "mixamorig:Spine2", arm_offsets),
            (leg, "mixamorig:Hips", leg_offsets),
        ):
            parent = root
            for name, (x, y, z) in zip(names, offsets, strict=True):
                bones.append((f"mixamorig:{side}{name}", parent, (sign * x, y, z)))
                parent = f"mixamorig:{side}{name}"
    return built(bones, {"mixamorig:Head": (0, 0.2, 0)})


def quadruped() -> Skeleton:
    """Four legs, a neck to the front, a tail to the back."""
    bones: list[Bone] = [
        ("pelvis", None, (0, 0, 0)),
        ("spine", "pelvis", (0, 0.02, 0.3)),
        ("withers", "spine", (0, 0.02, 0.3)),
        ("neck", "withers", (0, 0.15, 0.18)),
        ("head", "neck", (0, 0.12, 0.15)),
        ("tail", "pelvis", (0, 0.02, -0.12)),
        ("tail2", "tail", (0, -0.05, -0.15)),
    ]
    for name, root, z in (("hind", "pelvis", 0.0), ("fore", "withers", 0.02)):
        for side, x in (("Left", 0.12), ("Right", -0.12)):
            bones += [
                (f"{name}{side}Hip", root, (x, -0.08, z)),
                (f"{name}{side}Knee", f"{name}{side}Hip", (0, -0.32, 0.02)),
                (f"{name}{side}Ankle", f"{name}{side}Knee", (0, -0.30, -0.03)),
            ]
    return built(bones, {"head": (0, -0.05, 0.2), "tail2": (0, -0.1, -0.1)})


def one_joint() -> Skeleton:
    """Hardly a body."""
    return built([("thing", None, (0, 0, 0))], {"thing": (0, 0.5, 0)})


def bvh_skeleton(path: Path) -> Skeleton:
    """The skeleton of a recording."""
    return read_bvh(path, metres_per_unit=0.01).skeleton


def all_along_x() -> Skeleton:
    """At rest every bone points along x, as in some recordings; the motion alone says how it stands."""
    bones: list[Bone] = [
        ("Hips", None, (0, 0, 0)),
        ("Spine", "Hips", (0.07, -0.06, 0)),
        ("Spine1", "Spine", (0.125, 0, 0)),
        ("Spine2", "Spine1", (0.125, 0, 0)),
        ("Neck", "Spine2", (0.25, 0, 0)),
        ("Head", "Neck", (0.12, 0, 0)),
    ]
    for side, z in (("Left", 1), ("Right", -1)):
        bones += [
            (f"{side}UpLeg", "Hips", (0, 0.02, 0.11 * z)),
            (f"{side}Leg", f"{side}UpLeg", (0.43, 0, 0)),
            (f"{side}Foot", f"{side}Leg", (0.42, 0, 0)),
            (f"{side}Toe", f"{side}Foot", (0.17, 0, 0)),
            (f"{side}Shoulder", "Spine2", (0.12, 0.01, 0.05 * z)),
            (f"{side}Arm", f"{side}Shoulder", (0.11, 0, 0)),
            (f"{side}ForeArm", f"{side}Arm", (0.33, 0, 0)),
            (f"{side}Hand", f"{side}ForeArm", (0.25, 0, 0)),
        ]
    return built(bones)


ALL = {
    "dancer": dancer,
    "toy": toy,
    "mixamo": mixamo,
    "quadruped": quadruped,
    "one joint": one_joint,
    "all along x": all_along_x,
}
