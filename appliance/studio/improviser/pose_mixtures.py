"""The improviser of 'Beyond Imitation': an LSTM with mixtures that draws the next poses from those before.

As published: principal components that keep 95 % of the variance, LSTM layers over a look-back of 10 to 128
poses, a mixture of Gaussians over the next 1 to 4. Ours goes on by whole moves (improviser.py). Poses are
joint rotations here, markers there; and it samples, where the published notebook takes the mixture's mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from appliance.dancer.material.improvising import FARTHEST
from appliance.dancer.material.steps import ROOT, Steps
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, Dataset
from appliance.studio.evaluation.coders import Poses
from appliance.studio.improviser.improviser import Mixture
from appliance.studio.improviser.moves import Scale, StepShape
from appliance.studio.improviser.pose_steps import pose_motion, pose_steps
from appliance.studio.studio_error import StudioError

NARROWEST = math.log(0.01)  # log scale, of standardised numbers: neighbouring poses are hundredths apart
FADE = 8  # poses of a prompt that are danced again, for what principal components lose is faded in


@dataclass(frozen=True)
class PoseMixturesShape(StepShape):
    """back, ahead: poses that it sees and predicts; width and depth of its LSTM; mixtures: Gaussians."""

    back: int = 32
    ahead: int = 1
    width: int = 128
    depth: int = 3
    mixtures: int = 8


class PoseMixtures(nn.Module):
    """Maps the last poses to the distribution of the next ones."""

    def __init__(self, shape: PoseMixturesShape) -> None:
        super().__init__()
        self.shape, self.scale = shape, Scale(shape)
        self.lstm = nn.LSTM(shape.inside, shape.width, num_layers=shape.depth, batch_first=True)
        self.head = nn.Linear(shape.width, shape.mixtures * (2 * shape.ahead * shape.inside + 1))
        self.rest: Tensor
        self.register_buffer("rest", torch.zeros(shape.latent // 4, 4))

    def forward(self, before: Tensor) -> Mixture:
        """before (B, back, inside) -> the distribution of the next (B, ahead * inside)."""
        remembered, _ = self.lstm(before)
        return Mixture.of(self.head(remembered[:, -1]).float(), self.shape.mixtures, NARROWEST)

    @torch.no_grad()
    def improvise(self, primer: Tensor, steps: int, temperature: float, seed: int) -> Tensor:
        """Continue a primer (B, back or more, features) by (B, steps, features), on its own output."""
        rng, shape = np.random.default_rng(seed), self.shape
        x = self.scale.inside(primer)[:, -shape.back :]
        danced = []
        for _ in range(math.ceil(steps / shape.ahead)):
            drawn = self(x).sample(temperature, rng).clamp(-FARTHEST, FARTHEST)
            danced.append(drawn.view(len(x), shape.ahead, shape.inside))
            x = torch.cat([x, danced[-1]], 1)[:, -shape.back :]
        return self.scale.features(torch.cat(danced, 1)[:, :steps])


def components_of(poses: Tensor, share: float) -> int:
    """How many principal components of poses (N, D) keep this share of their variance."""
    variances = torch.linalg.eigvalsh(torch.cov(poses.T.double())).flip(0).clamp_min(0)
    kept = int((variances.cumsum(0) < share * variances.sum()).sum()) + 1
    return min(kept, poses.shape[1])


@dataclass(frozen=True)
class PoseImproviser:
    """A trained network and the joints (M,) that it moves; rest (M, 4): their hemisphere."""

    network: PoseMixtures
    joints: tuple[str, ...]
    rest: Poses

    def dances(
        self, starts: Tensor, dataset: Dataset, seconds: float, temperature: float, seed: int
    ) -> list[Recording]:
        """Its dance on its own output after each of the starts (B, T, features), from the origin on."""
        made = self.network.improvise(starts, round(seconds * FPS) + 1, temperature, seed)
        return [self._recording(one.numpy(), dataset) for one in made]

    def follow(
        self, prompt: Recording, dataset: Dataset, seconds: float, temperature: float, seed: int
    ) -> tuple[Recording, int, int]:
        """As prompt.Follower asks for. Raises StudioError for a prompt shorter than its look-back."""
        features, back = pose_steps(prompt, dataset.moving, self.rest).features, self.network.shape.back
        if len(features) < max(back, FADE):
            raise StudioError(
                f"The prompt has {len(prompt) / FPS:.1f} s; this network looks back {back / FPS:.1f} s. Give "
                "a longer one, or a later --from."
            )
        steps = round(seconds * FPS) + 1
        danced = self.network.improvise(torch.tensor(features)[None], steps, temperature, seed)[0].numpy()
        together = np.concatenate([features[-FADE:], danced])
        return self._recording(together, dataset), len(prompt) - FADE, FADE

    def _recording(self, features: Poses, dataset: Dataset) -> Recording:
        poses, roots = pose_motion(Steps.of_features(features), dataset.still_pose(), dataset.moving)
        return Recording(dataset.skeleton, poses, roots, FPS)


def shape_for(poses: Tensor, variance: float, sizes: dict[str, int]) -> PoseMixturesShape:
    """For a network with features (N, M * 4 + 4)."""
    latent = poses.shape[1] - ROOT
    return PoseMixturesShape(latent, components_of(poses[:, :latent], variance), ROOT, **sizes)
