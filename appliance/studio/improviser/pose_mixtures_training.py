"""The training of the published LSTM with mixtures, read top to bottom; seeded, resumable, in processes."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from appliance.studio.data.dataset import Dataset
from appliance.studio.improviser.improviser import Mixture
from appliance.studio.improviser.improviser_training import ImproviserReport, laid_out
from appliance.studio.improviser.pose_mixtures import (
    PoseImproviser,
    PoseMixtures,
    PoseMixturesShape,
    shape_for,
)
from appliance.studio.improviser.pose_steps import pose_stretches
from appliance.studio.processes import Processes
from appliance.studio.studio_error import StudioError
from appliance.studio.training_loop import ALONE, TrainingLoop


@dataclass(frozen=True)
class PoseMixturesSettings:
    """How to train, as published; minutes bounds the wall time and paces the learning rate, unless steps is
    given. window: poses of the look-back; ahead: poses predicted; variance: that the components keep.
    """

    model: str = "improviser"
    network: str = "lstm-mixtures"
    seed: int = 1
    minutes: float = 15.0
    steps: int = 0
    window: int = 32
    ahead: int = 1
    width: int = 128
    depth: int = 3
    mixtures: int = 8
    variance: float = 0.95
    batch: int = 128
    learning_rate: float = 1e-5
    smoothing: float = 0.995
    mixed: bool = True


class PoseMixturesTraining(TrainingLoop[ImproviserReport]):
    """State of a training: network, averaged network, optimiser, history."""

    report_type = ImproviserReport
    saved = ("network", "averaged", "optimizer")

    def __init__(
        self,
        dataset: Dataset,
        settings: PoseMixturesSettings,
        device: str = "cpu",
        processes: Processes = ALONE,
    ) -> None:
        """Raises StudioError where no stretch of the recordings is long enough."""
        super().__init__(settings, processes, torch.device(device))
        torch.manual_seed(settings.seed)
        self.settings, self.dataset = settings, dataset
        rest, moving = dataset.still_pose()[list(dataset.moving)], dataset.moving
        self._length = settings.window + settings.ahead
        training, held_out = (
            pose_stretches(takes, moving, rest, self._length)
            for takes in (dataset.training, dataset.held_out)
        )
        if not training:
            raise StudioError(
                f"No recording has {self._length + 1} poses without a capture error. Take a shorter --window."
            )
        every = torch.cat(training)
        names = ("ahead", "width", "depth", "mixtures")
        sizes = {"back": settings.window, **{name: getattr(settings, name) for name in names}}
        self.network = PoseMixtures(shape_for(every, settings.variance, sizes))
        self.network.scale.learn(every)
        self.network.rest.copy_(torch.tensor(rest))
        self.rows, self.starts = laid_out(training, self.network.scale, self._length)
        self.held_rows, self.held_starts = laid_out(held_out, self.network.scale, self._length)
        self.rows, self.held_rows = self.rows.to(self.device), self.held_rows.to(self.device)
        self.network.to(self.device)
        self.averaged = copy.deepcopy(self.network).requires_grad_(False)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=settings.learning_rate, fused=True)

    def report(self, means: Mapping[str, float]) -> ImproviserReport:
        return ImproviserReport(self.step, self.seconds, self.fraction, dict(means), self.held_out())

    def train_step(self) -> dict[str, Tensor]:
        """One step on a batch of recorded looks back and what came next."""
        for group in self.optimizer.param_groups:
            warm = min(1.0, (self.step + 1) / 100)
            group["lr"] = self.settings.learning_rate * warm * max(self._cosine(), 0.01)
        rows = self.processes.share(torch.randint(len(self.starts), (self.settings.batch,)))
        nats = self._nats(self.network, self.rows, self.starts[rows]).mean()
        self._descend(nats, self.optimizer, self.network)
        self._average_weights(self.averaged, self.network)
        self.step += 1
        return {"nats": nats.detach()}

    @torch.no_grad()
    def held_out(self, sample: int = 768) -> dict[str, float]:
        """Nats a number of held-out poses: of the averaged network, and of what needs no network.

        gaussian: the next pose, whatever came before; stays: the next pose where the last was, give or take a
        usual step. A number is a standardised component of a pose or of the root's way.
        """
        if not len(self.held_starts):
            return {}
        some = torch.linspace(0, len(self.held_starts) - 1, min(sample, len(self.held_starts))).long()
        starts = self.held_starts[some]
        found = [self._nats(self.averaged, self.held_rows, part) for part in torch.split(starts, 256)]
        usual = (self.rows[self.starts + 1] - self.rows[self.starts]).square().mean(0).sqrt().log()
        last, following = (
            self.held_rows[starts + at] for at in (self.settings.window - 1, self.settings.window)
        )
        off = ((following - last) * torch.exp(-usual)).square()
        constant = 0.5 * math.log(2 * math.pi)
        return {
            "nats": float(torch.cat(found).mean()),
            "gaussian": constant + 0.5 * float(following.square().mean()),
            "stays": constant + float((0.5 * off + usual).mean()),
        }

    def state(self) -> dict[str, Any]:
        """Everything that a resumed training and improvising need."""
        return {
            **self._shared_state(),
            "settings": asdict(self.settings),
            "shape": asdict(self.network.shape),
            "joints": list(self.dataset.moving_names),
        }

    def _nats(self, network: PoseMixtures, rows: Tensor, starts: Tensor) -> Tensor:
        """(B,) nats a number of what comes after the looks back that begin at `starts`."""
        poses = rows[(starts[:, None] + torch.arange(self._length)).to(rows.device)]
        with self.mixed:
            mixture: Mixture = network(poses[:, : self.settings.window])
        return mixture.negative_log_likelihood(poses[:, self.settings.window :].flatten(1))


def load_pose_improviser(path: Path) -> tuple[PoseImproviser, dict[str, Any]]:
    """The averaged network of a checkpoint with its joints, and the whole state."""
    state = torch.load(path, map_location="cpu", weights_only=True)
    network = PoseMixtures(PoseMixturesShape(**state["shape"]))
    network.load_state_dict(state["averaged"])
    network.requires_grad_(False).eval()
    return PoseImproviser(network, tuple(state["joints"]), network.rest.numpy()), state
