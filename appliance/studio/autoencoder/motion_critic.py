"""The motion critic: distinguishes a third of a second of held dance, as seen by an audience, from the real.

A loss by distance between windows cannot say whether a dance lives: it is met by the mean. The critic sees
blended motion, as it leaves the box: poses, speeds and accelerations of all joints, which joints are held,
and how far they are from the hand. Real are the recordings with their own joints as the hand; made are
dances with hands of other moments, and dances without a hand. It learns beside the network, which learns to
convince it (Goodfellow et al. 2014, non-saturating; gradient penalty R1 on the real, Mescheder et al. 2018).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from appliance.dancer.blending import weights
from appliance.dancer.extrapolation import SPAN, Extrapolation
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.answers import held_weights
from appliance.studio.autoencoder.coupled import matrix_of_products
from appliance.studio.data.dataset import Dataset

WINDOWS, HOP = 12, 2  # windows in a sequence, one every second tick
PENALTY_EVERY, PENALTY = 4, 0.06
# Standard deviations for poses, speeds, accelerations: no numerical fingerprint counts.
_NOISE = (0.06, 0.3, 0.5)
_MOST = 8.0
_FEWEST_SHARE, _MOST_SHARE = 0.2, 0.35  # shares of the batches with 2 passes and with the most
_WANDERING = ("pool", "age", "end")
_POOL, _WANDER = 64, 100  # sequences that are coded over and over, and passes at most
_CARRIED = 4096  # ticks extrapolated at a time
_HAND = 6.0  # scale of a difference of rotation matrices between joint and hand


class Sequence(NamedTuple):
    """A batch of sequences. windows (B, W, T, M, 4), one every HOP ticks, with heading; targets of the same
    shape: what the box makes of each joint as a hand (extrapolated over the window).
    """

    windows: Tensor
    targets: Tensor

    def as_hands_of(self, dance: Tensor) -> Tensor:
        """Targets (B, W, T, M, 4) with the root's heading that windows (B, W, T, M, 4) have."""
        middle = dance.shape[2] // 2
        theirs, own = (rotation.heading(each[:, :, middle, 0]) for each in (dance, self.windows))
        turn = rotation.multiply(theirs, rotation.inverse(own))[:, :, None].expand_as(self.targets[..., 0, :])
        root = rotation.multiply(turn, self.targets[..., 0, :])
        return torch.cat([root[..., None, :], self.targets[..., 1:, :]], dim=3)


class Wandering(NamedTuple):
    """Windows (B, W, T, M, 4) of sequences on their way, and where they came from."""

    windows: Tensor
    pool: Tensor
    age: Tensor
    rows: Tensor

    def go_on(self, made: Tensor, passes: int) -> None:
        """Keep what the network made of the windows."""
        self.pool[self.rows] = made.detach()
        self.age[self.rows] += passes


class Sequences:
    """Sequences of a dataset's training takes, as they were recorded."""

    def __init__(self, dataset: Dataset, window: int, device: torch.device) -> None:
        """Keeps the poses, and the targets of every tick; windows are gathered when a batch is drawn."""
        span = 2 * SPAN + (WINDOWS - 1) * HOP + window
        poses, starts, offset = [], [], 0
        for take in dataset.training:
            moving = quaternion.continuous(take.recording.poses[:, dataset.moving]).astype(np.float32)
            if len(moving) >= span:
                sound = np.lib.stride_tricks.sliding_window_view(take.sound, span).all(axis=-1)
                starts.append(offset + np.flatnonzero(sound) + 2 * SPAN)
            poses.append(moving)
            offset += len(moving)
        all_poses = np.concatenate(poses)
        self._poses = torch.from_numpy(all_poses).to(device)
        self._targets = torch.from_numpy(extrapolated(all_poses, window)).to(device)
        self._starts = torch.from_numpy(np.concatenate(starts) if starts else np.zeros(0, np.intp)).to(device)
        self._ticks = HOP * torch.arange(WINDOWS, device=device)
        self._within = torch.arange(window, device=device)
        shape = (_POOL, WINDOWS, window, *all_poses.shape[1:])
        self._pool = torch.zeros(shape, device=device)
        self._age, self._end = (torch.zeros(_POOL, device=device) for _ in range(2))

    def __len__(self) -> int:
        return len(self._starts)

    def draw(self, count: int) -> Sequence:
        """A random batch."""
        chosen = torch.randint(len(self._starts), (count,)).to(self._starts.device)
        ticks = self._starts[chosen, None] + self._ticks
        return Sequence(self._poses[ticks[..., None] + self._within], self._targets[ticks])

    def wandering(self, count: int) -> Wandering:
        """Some of the sequences that are coded over and over; those that wandered enough begin anew."""
        ended = (self._age >= self._end).nonzero()[:, 0]
        self._pool[ended] = self.draw(len(ended)).windows
        self._age[ended] = 0
        self._end[ended] = _WANDER * torch.rand(len(ended), device=self._end.device).square() + 1
        rows = torch.randperm(_POOL)[:count].to(self._pool.device)
        return Wandering(self._pool[rows], self._pool, self._age, rows)

    def state(self) -> dict[str, Tensor]:
        """The state that later sequences depend on besides the random numbers, for `restore`."""
        return {name: getattr(self, f"_{name}") for name in _WANDERING}

    def restore(self, state: dict[str, Tensor]) -> None:
        """Continue from a state."""
        for name in _WANDERING:
            getattr(self, f"_{name}").copy_(state[name])


def extrapolated(poses: Array, window: int) -> Array:
    """(N, window, M, 4): at each tick of poses (N, M, 4), each joint carried on from what it did until then,
    as the box does it; zero where too little is known.
    """
    count, joints = len(poses), poses.shape[1]
    targets = np.zeros((count, window, joints, 4), dtype=np.float32)
    for begin in range(2 * SPAN, count, _CARRIED):
        ticks = np.arange(begin, min(begin + _CARRIED, count))
        rows = ticks.size * joints
        extrapolation = Extrapolation(rows, window)
        out = np.empty((window, rows, 4), dtype=np.float32)
        for back in range(2 * SPAN, -1, -1):
            is_new = np.full((rows, 1), back == 2 * SPAN)
            extrapolation(poses[ticks - back].reshape(-1, 4), is_new, out)
        targets[ticks] = out.reshape(window, ticks.size, joints, 4).swapaxes(0, 1)
    return targets


class MotionCritic(nn.Module):
    """Logits of blended motion: high for what the dancer might do with these joints held so."""

    def __init__(self, joints: int, poses: int, width: int = 384) -> None:
        super().__init__()
        size = 6 * joints * (3 * poses - 3) + 7 * joints
        self.layers = nn.Sequential(
            nn.Linear(size, width),
            nn.LeakyReLU(0.2),
            nn.Linear(width, 2 * width // 3),
            nn.LeakyReLU(0.2),
            nn.Linear(2 * width // 3, 1),
        )
        self.matrix: Tensor
        for name in ("middle", "spread", "speeds", "accelerations"):
            self.register_buffer(name, torch.zeros(joints, 6))
        self.register_buffer("matrix", matrix_of_products()[:, [0, 1, 3, 4, 6, 7]], persistent=False)

    def forward(self, features: Tensor) -> Tensor:
        """(B,) from features (B, F)."""
        logits: Tensor = self.layers(features)
        return logits[:, 0]

    @torch.no_grad()
    def measure(self, motion: Tensor) -> None:
        """Scale the features by the dancer's own motion (B, P, M, 4)."""
        poses = self._axes(motion)
        self.middle, self.spread = poses.mean((0, 1)), poses.std((0, 1)) + 0.02
        self.speeds = poses.diff(dim=1).std((0, 1)) + 0.003
        self.accelerations = poses.diff(dim=1, n=2).std((0, 1)) + 0.001

    def features(self, motion: Tensor, target: Tensor, held: Tensor) -> Tensor:
        """(B, F) of level motion (B, P, M, 4); target (B, M, 4): where hands want the joints in its middle;
        held (B, M).
        """
        poses = self._axes(motion)
        parts = [
            (poses - self.middle) / self.spread,
            poses.diff(dim=1) / self.speeds,
            poses.diff(dim=1, n=2) / self.accelerations,
        ]
        noisy = [
            (part + noise * torch.randn_like(part)).clamp(-_MOST, _MOST).flatten(1)
            for part, noise in zip(parts, _NOISE, strict=True)
        ]
        there = poses[:, poses.shape[1] // 2].detach()
        apart = _HAND * (self._axes(target) - there) * held[..., None]
        return torch.cat([*noisy, held, apart.flatten(1)], dim=1)

    def _axes(self, poses: Tensor) -> Tensor:
        """(..., 4) -> (..., 6): the first two columns of rotation matrices (Zhou et al. 2019)."""
        products = (poses[..., :, None] * poses[..., None, :]).flatten(-2)
        return torch.matmul(products, self.matrix)


def blended_poses(window: int) -> int:
    """Poses of the motion that `blended` makes of a sequence; below 3 there is nothing to look at."""
    return WINDOWS - _older(window)


def _older(window: int) -> int:
    """How many windows are blended with the newest one."""
    return -(-window // HOP) - 1


def blended(windows: Tensor) -> Tensor:
    """(B, W, T, M, 4) -> (B, P, M, 4): overlapping windows, one every HOP ticks, blended as in the box."""
    shares = torch.from_numpy(weights(windows.shape[2], 1, "prompt"))[::HOP].to(windows.device)
    older = _older(windows.shape[2])
    newest = windows[:, older:, 0]
    motion = shares[0] * newest
    for back in range(1, older + 1):
        pose = windows[:, older - back : WINDOWS - back, HOP * back]
        side = torch.where((pose * newest).sum(-1, keepdim=True) < 0, -1.0, 1.0)
        motion = motion + shares[back] * side * pose
    return rotation.normalize(motion)


def level(motion: Tensor, target: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Motion (B, P, M, 4) and target (B, M, 4) without the heading of the motion's middle."""
    facing = rotation.inverse(rotation.heading(motion[:, motion.shape[1] // 2, 0]))
    root = rotation.multiply(facing[:, None].expand_as(motion[:, :, 0]), motion[:, :, 0])
    levelled = torch.cat([root[:, :, None], motion[:, :, 1:]], dim=2)
    if target is None:
        return levelled, motion
    there = rotation.multiply(facing, target[:, 0])
    return levelled, torch.cat([there[:, None], target[:, 1:]], dim=1)


def middle_target(targets: Tensor) -> Tensor:
    """(B, M, 4) of targets (B, W, T, M, 4): where the hand is in the middle of the blended motion."""
    return targets[:, _older(targets.shape[2]) + blended_poses(targets.shape[2]) // 2, 0]


def draw_passes(most: int) -> int:
    """2, the most, or any number in between."""
    kind = float(torch.rand(()))
    if kind < _FEWEST_SHARE:
        return 2
    return most if kind < _FEWEST_SHARE + _MOST_SHARE else int(torch.randint(2, most + 1, ()))


def draw_hands(count: int, chances: Tensor, free: int) -> Tensor:
    """(count, M): 1 where a joint is held; the first `free` dances have no hand."""
    held = held_weights(count, chances, 0.0)
    held[:free] = 0.0
    return held


def alive_loss(critic: MotionCritic, features: Tensor) -> Tensor:
    """The network's loss: how well the critic tells features (B, F) of its motion from the dancer."""
    critic.requires_grad_(False)
    loss = functional.softplus(-critic(features)).mean()
    critic.requires_grad_(True)
    return loss


def off_hand_loss(motion: Tensor, target: Tensor, held: Tensor) -> Tensor:
    """Radians from joints held by (B, M) to targets (B, M, 4) in the middle of level motion (B, P, M, 4)."""
    apart = (motion[:, motion.shape[1] // 2] * target).sum(-1).abs()
    chord = (2 * (1 - apart).clamp_min(1e-6)).sqrt()
    return 2 * (chord * held).sum() / held.sum().clamp_min(1.0)


def critic_loss(critic: MotionCritic, real: Tensor, made: Tensor, with_penalty: bool) -> Tensor:
    """The critic's loss for confusing features (B, F) of real and made motion."""
    real = real.detach().requires_grad_(with_penalty)
    true, false = critic(real), critic(made.detach())
    loss = functional.softplus(-true).mean() + functional.softplus(false).mean()
    if with_penalty:
        (slope,) = torch.autograd.grad(true.sum(), real, create_graph=True)
        loss = loss + PENALTY * slope.square().sum(-1).mean()
    return loss
