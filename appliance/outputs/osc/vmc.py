"""Dialect of the Virtual Motion Capture protocol (protocol.vmc.info), for Unity, Unreal and VRM avatars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.outputs.osc.template import bundles, message
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import humanoid_rest

# Ours is right-handed, Unity's left-handed; both have Y up and a figure that faces +Z. Mirroring X turns one
# into the other: (x, y, z) -> (-x, y, z). A rotation by some angle about an axis becomes one by minus the
# angle about the mirrored axis: (w, x, y, z) -> (w, x, -y, -z).
_MIRRORED_POSITION = np.array([-1, 1, 1], np.float32)
_MIRRORED_ROTATION = np.array([1, 1, -1, -1], np.float32)
_WXYZ_IN_MESSAGE = [6, 3, 4, 5]  # a bone's floats are px, py, pz, qx, qy, qz, qw
TIME_WRAP_S = 65536.0  # 32-bit seconds still tell two ticks apart just below it (steps of 7.8 ms)
_LOADED, _CALIBRATED, _NORMAL_MODE = 1, 3, 0
_TURNED_DEGREES = 0.01


class Vmc:
    """`/VMC/Ext/OK`, `/VMC/Ext/T`, `/VMC/Ext/Root/Pos` and a `/VMC/Ext/Bone/Pos` for each Unity bone.

    Each bone: name, position (metres) and rotation (x, y, z, w) in Unity's axes, relative to the next bone
    above it that has a Unity name; joints between the two are folded in. Rotations count from a T-pose in
    which no bone is turned, whatever the skeleton's zero pose is. Hips are relative to the root, which stays
    at the origin. Bundles that fit an Ethernet frame.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        joint_of = humanoid_bones(skeleton.names)
        self._hips = joint_of.pop("Hips")
        below_hips = sorted(joint_of.items(), key=lambda bone: bone[1])
        names = ["Hips", *(name for name, _ in below_hips)]
        joints = [self._hips, *(joint for _, joint in below_hips)]
        above = [_bone_above(skeleton, joint, joints) for joint in joints]
        self._joints = np.array(joints)
        self._folded = np.array(
            [i for i in range(1, len(joints)) if above[i] != skeleton.parents[joints[i]]], dtype=np.intp
        )
        self._folded_joints, self._folded_above = self._joints[self._folded], np.array(above)[self._folded]
        self._rotations = np.empty((len(joints), 4), np.float32)
        rest = humanoid_rest(skeleton)
        self._above_at_rest = rest[above].astype(np.float32)
        self._above_at_rest[0] = quaternion.IDENTITY
        self._back_to_rest = quaternion.inverse(rest[joints]).astype(np.float32)
        turned = np.degrees(quaternion.angle_between(rest[joints], quaternion.IDENTITY))
        self._counts_from_rest = bool((turned > _TURNED_DEGREES).any())
        reach = quaternion.rotate(rest[above], skeleton.offsets[joints])
        self._positions = reach.astype(np.float32) * _MIRRORED_POSITION

        self._template = bundles(
            [
                message("/VMC/Ext/OK", _LOADED, _CALIBRATED, _NORMAL_MODE),
                message("/VMC/Ext/T", floats=1),
                message("/VMC/Ext/Root/Pos", "root", floats=7),
                *(message("/VMC/Ext/Bone/Pos", name, floats=7) for name in names),
            ]
        )
        _, time_place, root_place, *bone_places = self._template.places
        self._time_place = time_place[0]
        self._template.numbers[root_place] = [0, 0, 0, 0, 0, 0, 1]
        self._position_places = np.stack(bone_places)[:, :3]
        self._rotation_places = np.stack(bone_places)[:, _WXYZ_IN_MESSAGE]
        self._first_time: float | None = None

    def encode(self, frame: JointFrame, puppet: PuppetFrame) -> Sequence[memoryview]:
        """Datagrams of this frame; the same buffers each time."""
        if self._first_time is None:
            self._first_time = frame.frame_time
        np.take(puppet.pose, self._joints, axis=0, out=self._rotations)
        self._rotations[0] = puppet.world[self._hips]
        self._positions[0] = puppet.positions[self._hips] * _MIRRORED_POSITION
        if len(self._folded):
            self._fold(puppet)
        if self._counts_from_rest:
            self._rotations[:] = quaternion.multiply(
                self._above_at_rest, quaternion.multiply(self._rotations, self._back_to_rest)
            )
        self._rotations *= _MIRRORED_ROTATION
        numbers = self._template.numbers
        numbers[self._time_place] = (frame.frame_time - self._first_time) % TIME_WRAP_S
        numbers[self._position_places] = self._positions
        numbers[self._rotation_places] = self._rotations
        return self._template.datagrams

    def _fold(self, puppet: PuppetFrame) -> None:
        """Bones whose parent joint has no Unity name: through the world into the frame of the bone above."""
        from_world = quaternion.inverse(puppet.world[self._folded_above])
        reach = puppet.positions[self._folded_joints] - puppet.positions[self._folded_above]
        self._rotations[self._folded] = quaternion.multiply(from_world, puppet.world[self._folded_joints])
        reach = quaternion.rotate(quaternion.multiply(self._above_at_rest[self._folded], from_world), reach)
        self._positions[self._folded] = reach * _MIRRORED_POSITION


def _bone_above(skeleton: Skeleton, joint: int, bones: list[int]) -> int:
    """The next joint above that is a bone too; the hips (first of `bones`) where there is none."""
    above = skeleton.parents[joint]
    while above >= 0 and above not in bones:
        above = skeleton.parents[above]
    return above if above >= 0 else bones[0]
