"""Quaternion maths for training: the functions of appliance.pose that need a gradient, in torch."""

from __future__ import annotations

import functools
from typing import NamedTuple

import torch
from torch import Tensor

from appliance.pose.skeleton import Skeleton


def multiply(a: Tensor, b: Tensor) -> Tensor:
    """Hamilton product (..., 4) x (..., 4) -> (..., 4), order w, x, y, z."""
    if a.is_cuda:  # three kernels in place of 28: starting them costs more than what they compute
        return torch.matmul((a[..., :, None] * b[..., None, :]).flatten(-2), _product_table(a.device))
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    return torch.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        dim=-1,
    )


@functools.cache
def _product_table(device: torch.device) -> Tensor:
    """(16, 4): from the products of the components of two quaternions to their Hamilton product."""
    units = torch.eye(4)
    left, right = units.repeat_interleave(4, dim=0), units.repeat(4, 1)
    return multiply(left, right).to(device)


def inverse(q: Tensor) -> Tensor:
    """Inverse of a unit quaternion."""
    return torch.cat([q[..., :1], -q[..., 1:]], dim=-1)


def normalize(q: Tensor) -> Tensor:
    """Unit length along the last axis."""
    unit: Tensor = q / q.norm(dim=-1, keepdim=True)
    return unit


def rotate(q: Tensor, v: Tensor) -> Tensor:
    """Turn vectors (..., 3)."""
    u = q[..., 1:]
    twice = 2 * torch.linalg.cross(u, v, dim=-1)
    turned: Tensor = v + q[..., :1] * twice + torch.linalg.cross(u, twice, dim=-1)
    return turned


def heading(q: Tensor) -> Tensor:
    """Twist about the vertical (+Y) of a world rotation; the identity where none exists."""
    twist = q * torch.tensor([1.0, 0.0, 1.0, 0.0], device=q.device)
    length = twist.norm(dim=-1, keepdim=True)
    identity = torch.tensor([1.0, 0.0, 0.0, 0.0], device=q.device).expand_as(q)
    return torch.where(length > 1e-6, twist / length.clamp_min(1e-6), identity)


def angle_between(a: Tensor, b: Tensor) -> Tensor:
    """Angle from a to b in radians, 0..pi."""
    chord = torch.minimum((a - b).norm(dim=-1), (a + b).norm(dim=-1))
    return 4 * torch.asin((chord / 2).clamp(max=1.0))


class Bones(NamedTuple):
    """How M moving joints hang on each other: parents, -1 for a root; turns (M, 4) and reaches (M, 3) in
    metres: what the still joints between a joint and its parent turn it by, and where that leaves it.
    """

    parents: list[int]
    turns: Tensor
    reaches: Tensor

    @property
    def levels(self) -> list[list[int]]:
        """The joints by the number of moving joints above them."""
        depth: list[int] = []
        for parent in self.parents:
            depth.append(0 if parent < 0 else depth[parent] + 1)
        return [[j for j, d in enumerate(depth) if d == level] for level in range(max(depth) + 1)]


def moving_bones(skeleton: Skeleton, moving: tuple[int, ...], still_pose: Tensor) -> Bones:
    """The moving joints of a skeleton; still_pose (J, 4): how its other joints always are."""
    parents, turns, reaches = [], [], []
    for joint in moving:
        turn, reach = torch.tensor([1.0, 0.0, 0.0, 0.0]), torch.zeros(3)
        child = joint
        while True:  # climb over still joints to the next moving one
            reach = reach + torch.tensor(skeleton.offsets[child], dtype=torch.float32)
            parent = skeleton.parents[child]
            if parent < 0 or parent in moving:
                break
            still = still_pose[parent].float()
            reach, turn = rotate(still, reach), multiply(still, turn)
            child = parent
        parents.append(moving.index(parent) if parent >= 0 else -1)
        turns.append(turn)
        reaches.append(reach)
    return Bones(parents, torch.stack(turns), torch.stack(reaches))


class MovingSkeleton(torch.nn.Module):
    """Forward kinematics of only the moving joints; the still joints between them are folded into the bones.

    The root joint stays at the origin: the figure is compared, not its path through the room.
    """

    def __init__(self, bones: Bones) -> None:
        super().__init__()
        # Joints of the same depth are turned together: a third of the operations of joint by joint.
        levels = bones.levels
        self.depth = len(levels)
        for depth, joints in enumerate(levels):
            above = [levels[depth - 1].index(bones.parents[joint]) for joint in joints] if depth else []
            self.register_buffer(f"joints{depth}", torch.tensor(joints), persistent=False)
            self.register_buffer(f"above{depth}", torch.tensor(above), persistent=False)
        order = [joint for level in levels for joint in level]
        self.order: Tensor
        self.turns: Tensor
        self.reaches: Tensor
        places = torch.tensor([order.index(joint) for joint in range(len(order))])
        self.register_buffer("order", places, persistent=False)
        self.register_buffer("turns", bones.turns)
        self.register_buffer("reaches", bones.reaches)

    def forward(self, pose: Tensor) -> Tensor:
        """(..., M, 4) -> positions (..., M, 3) in metres, relative to the root joint."""
        world = pose[..., self.get_buffer("joints0"), :]
        places = [torch.zeros_like(world[..., 1:])]
        for depth in range(1, self.depth):
            joints, above = self.get_buffer(f"joints{depth}"), self.get_buffer(f"above{depth}")
            parents = world[..., above, :]
            reach = rotate(parents, self.reaches[joints].expand(*parents.shape[:-1], 3))
            places.append(places[-1][..., above, :] + reach)
            turned = multiply(parents, self.turns[joints].expand_as(parents))
            world = multiply(turned, pose[..., joints, :])
        return torch.cat(places, dim=-2)[..., self.order, :]
