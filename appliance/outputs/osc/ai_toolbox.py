"""Dialect of the AI-Toolbox family: one flat list of floats a message, quaternions w, x, y, z."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.axes import turn_of
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.motion_features import PAUSE_S, Derivatives
from appliance.outputs.osc.template import message, single
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig

KINEMATICS = {"lin_vel": 3, "lin_acc": 3, "lin_jerk": 1, "rot_vel": 3, "rot_acc": 3, "ang_jerk": 1}

Floats = NDArray[np.float32]


class AiToolbox:
    """rot_local and rot_world (J x w, x, y, z), pos_world and pos_local (J x x, y, z), a datagram each; rot
    (J x x, y, z: radians about fixed axes, in the world) and the lists of kinematics.py likewise.

    Axes and units are the box's own (right-handed, Y up, metres) unless the receiver wants others. Local
    positions are relative to the parent joint, in its axes; the root's is its place in the world. A list
    cannot be split: above 86 joints a rotation message outgrows an Ethernet frame and travels in fragments.
    """

    def __init__(self, skeleton: Skeleton, config: OscConfig | None = None) -> None:
        config = config or OscConfig()
        self._layout = _Layout(skeleton, config)
        count, self._is_euler = len(self._layout.rows), config.rotations == "euler"
        turns = 3 if self._is_euler else 4
        widths = KINEMATICS | {"rot": 3, "pos_world": 3, "pos_local": 3}
        self._template = single(
            [
                message(f"{config.prefix}/{name}", floats=count * widths.get(name, turns))
                for name in config.messages
            ]
        )
        self._kinematics = Kinematics(count) if KINEMATICS.keys() & {*config.messages} else None
        numbers = self._template.numbers
        self._lists: list[tuple[str, Floats]] = [
            (name, numbers[place[0] : place[-1] + 1].reshape(count, -1))
            for name, place in zip(config.messages, self._template.places, strict=True)
        ]

    def encode(self, frame: JointFrame, puppet: PuppetFrame) -> Sequence[memoryview]:
        """Datagrams of this frame; the same buffers each time."""
        layout, kinematics = self._layout, self._kinematics
        if kinematics is not None and not frame.late:  # a late frame repeats the numbers before it
            turned = layout.rotations(puppet.world, "rot_world")
            kinematics.take_frame(layout.positions(puppet), turned, frame.frame_time)
        for name, numbers in self._lists:
            if kinematics is not None and name in KINEMATICS:
                numbers[...] = kinematics.lists[name]
            elif name.startswith("pos"):
                numbers[...] = layout.positions(puppet) if name == "pos_world" else layout.offsets(puppet)
            else:
                turned = layout.rotations(puppet.pose if name == "rot_local" else puppet.world, name)
                if name == "rot":
                    numbers[...] = _radians(turned)
                else:
                    numbers[...] = np.degrees(_radians(turned)) if self._is_euler else turned
        return self._template.datagrams


class _Layout:
    """Which rows a receiver's lists have, and in which axes and units.

    rows: the joint of each row, or the one whose bone ends there.
    """

    def __init__(self, skeleton: Skeleton, config: OscConfig) -> None:
        names = list(skeleton.names)
        wanted = [names.index(name) for name in config.joints] or list(range(len(names)))
        tips: dict[int, list[tuple[float, float, float]]] = {}
        for joint, offset in skeleton.ends if config.ends else ():
            tips.setdefault(joint, []).append(offset)
        rows = [(joint, tip) for joint in wanted for tip in (None, *tips.get(joint, ()))]
        self.rows = np.array([joint for joint, _ in rows])
        self._is_end = np.array([tip is not None for _, tip in rows])
        self._tips = np.array([tip for _, tip in rows if tip is not None], np.float32).reshape(-1, 3)
        self._roots = np.array([skeleton.parents[joint] < 0 and tip is None for joint, tip in rows])
        self._offsets = skeleton.offsets[self.rows].astype(np.float32)
        self._offsets[self._is_end] = self._tips
        self._is_plain = not config.joints and not self._is_end.any()
        turn = turn_of(config.axes)
        self._turn = None if np.array_equal(turn, np.eye(3)) else turn
        self._spin = turn * np.float32(round(float(np.linalg.det(turn))))  # an axis turns back in a mirror
        self._scale = np.float32(config.scale)

    def positions(self, puppet: PuppetFrame) -> Floats:
        """(R, 3): in the world."""
        found = puppet.positions if self._is_plain else puppet.positions[self.rows]
        if len(self._tips):
            found[self._is_end] += quaternion.rotate(puppet.world[self.rows[self._is_end]], self._tips)
        return self._placed(found)

    def offsets(self, puppet: PuppetFrame) -> Floats:
        """(R, 3): relative to the parent joint."""
        found = self._offsets.copy()
        found[self._roots] = puppet.positions[self.rows[self._roots]]
        return self._placed(found)

    def rotations(self, turned: Floats, name: str) -> Floats:
        """(R, 4): of all joints' rotations (J, 4); an end turns with its bone."""
        found = turned if self._is_plain else turned[self.rows]
        if name == "rot_local" and len(self._tips):
            found[self._is_end] = quaternion.IDENTITY
        if self._turn is None:
            return found
        seen = np.empty_like(found)
        seen[:, 0], seen[:, 1:] = found[:, 0], found[:, 1:] @ self._spin
        return seen

    def _placed(self, found: Floats) -> Floats:
        if self._turn is not None:
            found = found @ self._turn
        return found if self._scale == 1.0 else found * self._scale


def _radians(turned: Floats) -> Floats:
    """(R, 3): radians about the fixed axes x, then y, then z, of rotations (R, 4)."""
    w, x, y, z = turned.T
    about_x = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    about_y = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    about_z = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    radians: Floats = np.stack([about_x, about_y, about_z], axis=-1)
    return radians


class Kinematics:
    """Differences between one frame and the next, not smoothed.

    lists: by name, a row a joint: lin_vel, lin_acc (R, 3) in the units and axes of the positions; rot_vel,
    rot_acc (R, 3): radians about these axes; lin_jerk, ang_jerk (R, 1): their size.
    """

    def __init__(self, rows: int) -> None:
        self._moves, self._turns = Derivatives(rows, 3), Derivatives(rows, 2)
        self._turned, self._time = np.zeros((rows, 4), np.float32), -np.inf
        self.lists: dict[str, Floats] = {
            name: np.zeros((rows, width), np.float32) for name, width in KINEMATICS.items()
        }

    def take_frame(self, positions: Floats, rotations: Floats, seconds: float) -> None:
        """Positions (R, 3) and world rotations (R, 4) at a time; without time passed nothing is new."""
        passed_s, lists = seconds - self._time, self.lists
        if passed_s <= 0.0:
            return
        if passed_s > PAUSE_S:
            self._moves.begin()
            self._turns.begin()
            lists["rot_vel"][:] = 0.0
        else:
            turn = quaternion.multiply(rotations, quaternion.inverse(self._turned))
            sine = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
            angle = 2.0 * np.arctan2(sine, np.abs(turn[:, :1])) * np.copysign(1.0, turn[:, :1])
            lists["rot_vel"][:] = turn[:, 1:] * angle / (np.maximum(sine, 1e-9) * passed_s)
            self._turns.take(lists["rot_vel"], passed_s)
        self._moves.take(positions, passed_s)
        self._turned[:], self._time = rotations, seconds
        lists["lin_vel"][:], lists["lin_acc"][:], jerk = self._moves.found
        lists["rot_acc"][:], turning = self._turns.found
        lists["lin_jerk"][:, 0], lists["ang_jerk"][:, 0] = (
            np.linalg.norm(one, axis=1) for one in (jerk, turning)
        )
