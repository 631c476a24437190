"""Settling legs: gradient descent through forward kinematics, so that planted feet of a cycle stand still."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from appliance.dancer.forward_kinematics import soles_of
from appliance.dancer.grounding import PLANTED_PERCENTILE, sole_positions
from appliance.dancer.material.carrying import SMOOTH_FRAMES, planted
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.autoencoder import rotation

ROOT_SMOOTH_FRAMES = 15
Progress = Callable[[range], Iterable[int]]
STILL = 1e-3  # a joint whose quaternion changes less in the whole phrase takes no part


@dataclass(frozen=True)
class _Scales:
    """How much of each counts 1 in the loss."""

    slide_m_s: float = 0.06
    off_floor_m: float = 0.01
    below_floor_m: float = 0.004
    turn_radians: float = 0.12
    shift_m: float = 0.05


def settled(phrase: Recording, iterations: int, progress: Progress) -> Recording:
    """Legs and root of a cyclic phrase together, from a phrase whose root carries already."""
    scales, fps, count = _Scales(), phrase.fps, len(phrase)
    legs = _Legs(phrase.skeleton, phrase.poses)
    pose = torch.tensor(phrase.poses[:, legs.turned], dtype=torch.float32)
    root = torch.tensor(phrase.roots, dtype=torch.float32)
    points = sole_positions(phrase.skeleton, phrase.poses, phrase.roots)
    rest_heights = np.percentile(points[..., 1], PLANTED_PERCENTILE, axis=0)
    rest = torch.tensor(rest_heights, dtype=torch.float32)
    weight = torch.tensor(planted(points, rest_heights, fps), dtype=torch.float32)
    between = torch.sqrt(weight * weight.roll(-1, 0))
    turns = torch.zeros(count, len(legs.turned) - 1, 3, requires_grad=True)
    shifts = torch.zeros(count, 3, requires_grad=True)
    optimizer = torch.optim.Adam([turns, shifts], lr=0.01)
    pace = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, iterations)
    for _ in progress(range(iterations)):
        turn, shift = _smooth(turns, SMOOTH_FRAMES), _smooth(shifts, ROOT_SMOOTH_FRAMES)
        made = legs(_turned(pose, turn), root + shift)
        slide = (made.roll(-1, 0) - made)[..., [0, 2]] * fps
        loss = (
            (between * slide.square().sum(-1)).mean() / scales.slide_m_s**2
            + (weight * (made[..., 1] - rest).square()).mean() / scales.off_floor_m**2
            + functional.relu(rest - made[..., 1]).square().mean() / scales.below_floor_m**2
            + turn.square().sum(-1).mean() / scales.turn_radians**2
            + shift.square().sum(-1).mean() / scales.shift_m**2
        )
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        pace.step()
    with torch.no_grad():
        pose = _turned(pose, _smooth(turns, SMOOTH_FRAMES))
        root = root + _smooth(shifts, ROOT_SMOOTH_FRAMES)
    poses = phrase.poses.copy()
    poses[:, legs.turned] = quaternion.normalize(pose.double().numpy())
    roots = root.double().numpy() - [0.0, float(rest.min()), 0.0]
    return replace(phrase, poses=quaternion.continuous(poses), roots=roots)


class _Legs(torch.nn.Module):
    """Positions of the soles' points of a figure; everything but the root and the legs is still."""

    def __init__(self, skeleton: Skeleton, poses: Array) -> None:
        super().__init__()
        still_pose = poses[0]
        moving = (np.abs(poses - still_pose).max(axis=(0, 2)) > STILL).nonzero()[0]
        joints = len(skeleton)
        points = [point for foot in soles_of(skeleton) for point in foot]
        above = {joint for foot in skeleton.feet for joint in skeleton.ancestors(foot)}
        self.turned = sorted({0} | (above & set(moving.tolist())))
        ends = [point - joints for point in points if point >= joints]
        longer = Skeleton(
            (*skeleton.names, *(f"end {k}" for k in ends)),
            (*skeleton.parents, *(skeleton.ends[k][0] for k in ends)),
            np.concatenate([skeleton.offsets, np.array([skeleton.ends[k][1] for k in ends]).reshape(-1, 3)]),
        )
        tips = [joints + ends.index(point - joints) if point >= joints else point for point in points]
        chain = tuple(sorted({0, *self.turned, *tips}))
        identity = np.tile(quaternion.IDENTITY, (len(ends), 1))
        still = torch.tensor(np.concatenate([still_pose, identity]))
        self.body = rotation.MovingSkeleton(rotation.moving_bones(longer, chain, still))
        self.rows = [chain.index(joint) for joint in self.turned]
        self.tips = [chain.index(tip) for tip in tips]
        self.size = len(chain)

    def forward(self, pose: Tensor, root: Tensor) -> Tensor:
        """Poses (N, turned joints, 4), roots (N, 3) -> points (N, S, 3)."""
        whole = pose.new_zeros(len(pose), self.size, 4)
        whole[..., 0] = 1.0
        whole[:, self.rows] = pose
        positions: Tensor = self.body(whole)
        return positions[:, self.tips] + root[:, None]


def _turned(pose: Tensor, turn: Tensor) -> Tensor:
    """The legs (not the root, the first) turned by small rotation vectors (N, legs, 3)."""
    small = torch.cat([torch.ones_like(turn[..., :1]), turn / 2], -1)
    return torch.cat([pose[:, :1], rotation.multiply(pose[:, 1:], rotation.normalize(small))], 1)


def _smooth(values: Tensor, frames: int) -> Tensor:
    """Hann-weighted mean along the first axis of a cycle (N, ..., 3)."""
    weights = torch.hann_window(frames + 2, periodic=False)[1:-1]
    flat = values.flatten(1).T[:, None]
    half = frames // 2
    padded = functional.pad(flat, (half, half), mode="circular")
    mean = functional.conv1d(padded, (weights / weights.sum())[None, None])
    return mean[:, 0].T.reshape(values.shape)
