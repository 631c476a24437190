"""A dancer by the Virtual Motion Capture protocol (protocol.vmc.info), bone by bone, for this figure."""

from __future__ import annotations

import math
from collections.abc import Sequence

from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.pose.possible import FARTHEST_M
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import humanoid_rest

PREFIX = "/VMC/Ext/"
BONE, ROOT = f"{PREFIX}Bone/Pos", f"{PREFIX}Root/Pos"
_HIPS = "Hips"
_UNIT = 0.1  # a rotation this far from unit length is invalid
_OF_BODY = frozenset(  # without these a figure is not whole; fingers, eyes and toes few programs send
    ("Hips", "Spine", "Head", *(f"{side}{part}" for side in ("Left", "Right") for part in (
        "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot"
    )))
)  # fmt: skip

Quaternion = tuple[float, float, float, float]  # w, x, y, z
Vector = tuple[float, float, float]
_UNTURNED: Quaternion = (1.0, 0.0, 0.0, 0.0)


class VmcInput:
    """Collects the bones of a frame; what comes of them is a pose of the skeleton.

    Unity's axes are left-handed: X is mirrored, so (x, y, z, w) becomes (w, x, -y, -z). Rotations count from
    a T-pose, whatever the skeleton's zero pose is, and are relative to the next bone above: joints between
    two bones stay as in that T-pose where the lower one comes. Bones that come neither in this frame nor in
    the one before are unknown. Nothing in the protocol ends a frame: it is whole when all bones of the frame
    before have come, or one of them comes again.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._joint_of = humanoid_bones(skeleton.names)
        self._bones_of = _bones_of_joints(skeleton, self._joint_of)
        rest = [_as_quaternion(turn) for turn in humanoid_rest(skeleton).tolist()]
        above = [rest[parent] if parent >= 0 else _UNTURNED for parent in skeleton.parents]
        self._from_above, self._rest = [_inverse(turn) for turn in above], rest
        self._rotations = [0.0] * 4 * len(skeleton)
        for joint in range(len(skeleton)):
            self._turn(joint, _UNTURNED)
        self._root: tuple[Vector, Quaternion] = (0.0, 0.0, 0.0), _UNTURNED
        self._hips: tuple[Vector, Quaternion] = self._root
        self._came: set[str] = set()
        self._whole: set[str] = set()

    @property
    def bones(self) -> int:
        """How many bones this figure has."""
        return len(self._joint_of)

    @property
    def known(self) -> frozenset[str]:
        """Bones of this figure that came in the last two frames."""
        return frozenset(self._came | self._whole)

    @property
    def missing(self) -> list[str]:
        """Bones of this figure that did not come, those of the body first."""
        missing = [bone for bone in self._joint_of if bone not in self.known]
        return sorted(missing, key=lambda bone: bone not in _OF_BODY)

    @property
    def is_whole(self) -> bool:
        """Whether all bones of the body came."""
        return _OF_BODY.isdisjoint(self.missing)

    def hear(self, address: str, arguments: Sequence[object]) -> tuple[Vector, list[float]] | None:
        """One message; the hips' place in metres and all joints' w, x, y, z in the skeleton's order once a
        frame is whole, else None. An unknown value is not a number. Raises ValueError with one clear
        sentence.
        """
        if address not in (BONE, ROOT):
            return None
        name, place, rotation = parsed(address, arguments)
        if address == BONE and name not in self._joint_of:
            return None  # a name from outside never stays in memory
        if (address == ROOT or name == _HIPS) and max(map(abs, place)) > FARTHEST_M:
            raise ValueError(f"{address} {name}: no place is farther than {FARTHEST_M:g} m from the middle.")
        if not any(rotation):
            return None  # so some programs send what they do not track
        length = math.hypot(*rotation)
        if not abs(length - 1.0) < _UNIT:
            raise ValueError(f"{address} {name}: a rotation has the length 1, and {length:.3g} came.")
        w, x, y, z = (part / length for part in rotation)
        turned = w, x, y, z
        if address == ROOT:
            self._root = place, turned
            return None
        whole = None
        if name in self._came:  # the next frame has begun
            whole = None if self._came == self._whole else self._pose()
            self._whole, self._came = self._came, set()
        self._came.add(name)
        self._take(name, place, turned)
        return self._pose() if self._came == self._whole else whole

    def _take(self, name: str, place: Vector, turned: Quaternion) -> None:
        if name == _HIPS:
            self._hips = place, turned
        elif (joint := self._joint_of.get(name)) is not None:
            self._turn(joint, turned)

    def _turn(self, joint: int, turned: Quaternion) -> None:
        """A turn from the T-pose, in the axes of the bone above, becomes one from the zero pose."""
        local = _multiplied(_multiplied(self._from_above[joint], turned), self._rest[joint])
        self._rotations[4 * joint : 4 * joint + 4] = local

    def _pose(self) -> tuple[Vector, list[float]]:
        (root, root_turned), (hips, hips_turned) = self._root, self._hips
        self._turn(self._joint_of[_HIPS], _multiplied(root_turned, hips_turned))
        reach = _rotated(root_turned, hips)
        place = (root[0] + reach[0], root[1] + reach[1], root[2] + reach[2])
        rotations, known = list(self._rotations), self.known
        for joint, bones in enumerate(self._bones_of):
            if known.isdisjoint(bones):
                rotations[4 * joint : 4 * joint + 4] = [math.nan] * 4
        return place if _HIPS in known else (math.nan,) * 3, rotations


def _bones_of_joints(skeleton: Skeleton, joint_of: dict[str, int]) -> list[frozenset[str]]:
    """For each joint the bones that say how it turns: its own, else the next ones below it."""
    bone_of = {joint: bone for bone, joint in joint_of.items()}
    found: list[frozenset[str]] = [frozenset()] * len(skeleton)
    for joint in reversed(range(len(skeleton))):
        if joint in bone_of:
            found[joint] = frozenset((bone_of[joint],))
        parent = skeleton.parents[joint]
        if parent >= 0:
            found[parent] |= found[joint]
    return found


def parsed(address: str, arguments: Sequence[object]) -> tuple[str, Vector, Quaternion]:
    """Name, position and rotation in the box's axes. A root may have scale and offset behind them."""
    name, *numbers = arguments or ("",)
    values = [float(one) for one in numbers[:7] if isinstance(one, int | float)]
    if not isinstance(name, str) or len(values) != 7 or not all(map(math.isfinite, values)):
        raise ValueError(f"{address} takes a name and seven numbers: x, y, z, and a rotation as x, y, z, w.")
    x, y, z, turn_x, turn_y, turn_z, w = values
    return name[:1].upper() + name[1:], (-x, y, z), (w, turn_x, -turn_y, -turn_z)


def _multiplied(a: Quaternion, b: Quaternion) -> Quaternion:
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def _rotated(turned: Quaternion, vector: Vector) -> Vector:
    _, x, y, z = _multiplied(_multiplied(turned, (0.0, *vector)), _inverse(turned))
    return x, y, z


def _inverse(turned: Quaternion) -> Quaternion:
    return turned[0], -turned[1], -turned[2], -turned[3]


def _as_quaternion(values: Sequence[float]) -> Quaternion:
    w, x, y, z = values
    return w, x, y, z
