"""The poses of the last second as a texture, from which vertex shaders read where the body was at any age."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from appliance.body.skinning import BodyMesh, dual_quaternions
from appliance.outputs.coupling import ROWS, rows_between
from appliance.outputs.joint_frame import Floats
from appliance.projector.moment import Moment, PuppetMoment


@dataclass(frozen=True)
class Poses:
    """Where the joints were: row 0 now, row i ROW_S * i seconds ago; in figure heights, the floor at y = 0.

    positions: (ROWS, J, 3); world: (ROWS, J, 4). The joints of several figures follow each other.
    """

    positions: Floats
    world: Floats
    figures: int = 1

    @property
    def roots(self) -> Floats:
        """(ROWS, 3): the figure's root; of several the middle of theirs."""
        if self.figures == 1:
            return self.positions[:, 0]
        middle: Floats = self.each_root.mean(axis=1)
        return middle

    @property
    def apart(self) -> float:
        """How far a root is from their middle now, at most, along the floor; 0: one figure."""
        if self.figures == 1:
            return 0.0
        away = self.each_root[0] - self.roots[0]
        return float(np.hypot(away[:, 0], away[:, 2]).max())

    def of_figure(self, figure: int) -> Poses:
        if self.figures == 1:
            return self
        count = self.positions.shape[1] // self.figures
        own = slice(figure * count, (figure + 1) * count)
        return Poses(self.positions[:, own], self.world[:, own])

    @property
    def each_root(self) -> Floats:
        """(ROWS, figures, 3)."""
        return self.positions.reshape(ROWS, self.figures, -1, 3)[:, :, 0]


def together(poses: Sequence[Poses]) -> Poses:
    """Several figures as one."""
    if len(poses) == 1:
        return poses[0]
    positions, world = ([getattr(one, name) for one in poses] for name in ("positions", "world"))
    return Poses(np.concatenate(positions, axis=1), np.concatenate(world, axis=1), len(poses))


def poses_of(moment: Moment, puppet: PuppetMoment, height: float, sole: float) -> Poses:
    """A puppet's trail at even ages; height: the figure's, metres; sole: skin below the lowest joint, metres.

    Ages that the trail does not reach show its oldest pose.
    """
    times = np.array([*moment.trail_times, moment.time_s])
    positions = np.stack([*(at for at, _ in puppet.trail), puppet.positions])
    world = np.stack([*(turn for _, turn in puppet.trail), puppet.world])
    after, shares = rows_between(times, moment.time_s)
    share = shares[:, None, None]
    between = positions[after - 1] * (1 - share) + positions[after] * share
    earlier, later = world[after - 1], world[after]
    agrees = np.sum(earlier * later, axis=-1, keepdims=True) >= 0
    turned = earlier * (1 - share) + np.where(agrees, later, -later) * share
    turned /= np.maximum(np.linalg.norm(turned, axis=-1, keepdims=True), 1e-9)
    between[..., 1] -= _floor(positions, height, sole)
    return Poses((between / height).astype(np.float32), turned.astype(np.float32))


def _floor(positions: Floats, height: float, sole: float) -> float:
    """Height of the floor, metres: the stage's, 0, unless a recording has plainly put it elsewhere."""
    lowest = float(positions[..., 1].min()) - sole
    return lowest * float(np.clip((abs(lowest) / height - 0.12) / 0.12, 0.0, 1.0))


class HoldTexture:
    """How firmly hands hold each joint now: one texel a joint, red, 0..1."""

    def __init__(self, ctx: moderngl.Context, joints: int) -> None:
        self.most = 0.0  # what the most firmly held joint has
        self.texture = ctx.texture((joints, 1), 1, np.zeros(joints, np.float32).tobytes(), dtype="f4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def write(self, holds: Floats | None) -> None:
        """Bring the weights (J,) onto the GPU; None: no joint is held."""
        before, self.most = self.most, 0.0 if holds is None else float(np.max(holds, initial=0.0))
        if holds is not None and self.most > 0.0:
            self.texture.write(np.ascontiguousarray(holds, np.float32))
        elif before > 0.0:
            self.texture.write(np.zeros(self.texture.width, np.float32))

    def release(self) -> None:
        self.texture.release()


class PoseTexture:
    """Dual quaternions of all joints in all rows: joint j in texels 2j (rotation) and 2j + 1 (dual part)."""

    def __init__(self, ctx: moderngl.Context, mesh: BodyMesh, joints: int) -> None:
        self._bind = mesh.bind_positions / mesh.height, mesh.bind_world
        self.texture = ctx.texture((2 * joints, ROWS), 4, dtype="f4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def write(self, poses: Poses) -> None:
        """Bring the poses onto the GPU."""
        texels = dual_quaternions(*self._bind, poses.positions, poses.world)
        self.texture.write(np.ascontiguousarray(texels, np.float32))

    def release(self) -> None:
        self.texture.release()
