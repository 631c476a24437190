"""The training loop of the improviser, read top to bottom; seeded and resumable."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from appliance.dancer.material.improvising import BEFORE, MOVE
from appliance.studio.autoencoder.losses import divergence, sampled
from appliance.studio.improviser.improviser import Improviser
from appliance.studio.improviser.moves import MovesShape, Scale, move_loss
from appliance.studio.processes import Processes
from appliance.studio.training_loop import ALONE, TrainingLoop


@dataclass(frozen=True)
class ImproviserSettings:
    """How to train. minutes bounds the wall time and paces the learning rate, unless steps is given."""

    seed: int = 1
    minutes: float = 12.0
    steps: int = 0
    kept: int = 64
    code: int = 48
    width: int = 448
    lstm_width: int = 192
    lstm_layers: int = 1
    mixtures: int = 6
    batch: int = 128
    moves: int = 6  # in a row, 3.8 s: the span over which the memory is trained
    learning_rate: float = 1.5e-3
    dropout: float = 0.2
    closeness: float = 0.35  # tolerated error of a move, in standard deviations of a step
    input_noise: float = 0.1
    own: float = 0.9  # share of moves that continue the network's own steps, at the end of the training
    smoothing: float = 0.995
    mixed: bool = False  # precision: it trains on the processor
    model: str = "improviser"
    network: str = "moves"


@dataclass
class ImproviserReport:
    """A line of the training's history."""

    step: int
    seconds: float
    fraction: float
    parts: dict[str, float]
    held_out: dict[str, float]


class ImproviserTraining(TrainingLoop[ImproviserReport]):
    """State of a training: networks, averaged networks, optimiser, history."""

    report_type = ImproviserReport
    saved = ("improviser", "averaged", "optimizer")

    def __init__(
        self,
        training: Sequence[Tensor],
        held_out: Sequence[Tensor],
        ways: int,
        settings: ImproviserSettings,
        processes: Processes = ALONE,
    ) -> None:
        """training, held_out: stretches of steps (T, features); those shorter than a row are not used."""
        super().__init__(settings, processes)
        torch.manual_seed(settings.seed)
        self.settings = settings
        latent = training[0].shape[1] - ways
        shape = MovesShape(latent, min(settings.kept, latent), ways, settings.code, settings.width)
        self.improviser = Improviser(shape, settings.lstm_width, settings.lstm_layers, settings.mixtures)
        self.improviser.scale.learn(torch.cat(list(training)))
        self.averaged = copy.deepcopy(self.improviser).requires_grad_(False)
        scale = self.improviser.scale
        self.rows, self.starts = laid_out(training, scale, self._length)
        self.held_rows, self.held_starts = laid_out(held_out, scale, self._length)
        self.optimizer = torch.optim.Adam(self.improviser.parameters(), lr=settings.learning_rate, fused=True)

    def report(self, means: Mapping[str, float]) -> ImproviserReport:
        return ImproviserReport(self.step, self.seconds, self.fraction, dict(means), self.held_out())

    def train_step(self) -> dict[str, Tensor]:
        """One step on a batch of rows of moves, each continuing recorded or the network's own steps."""
        settings = self.settings
        for group in self.optimizer.param_groups:
            warm = min(1.0, (self.step + 1) / 100)
            group["lr"] = settings.learning_rate * warm * max(self._cosine(), 0.01)
        rows = self.processes.share(torch.randint(len(self.starts), (settings.batch,)))
        chosen = self.starts[rows]
        truth = self.rows[chosen[:, None] + torch.arange(self._length)]
        own = settings.own * min(1.0, 1.5 * self.fraction)
        parts = self._danced(self.improviser, truth, own, settings.dropout, settings.input_noise)
        numbers = MOVE * self.improviser.shape.inside
        weight = numbers / (2 * settings.closeness**2)
        loss = (weight * parts["moves"] + parts["divergence"]) / settings.code + parts["nats"]
        self._descend(loss, self.optimizer, self.improviser.moves, self.improviser.choreographer)
        self._average_weights(self.averaged, self.improviser)
        self.step += 1
        return {name: part.detach() for name, part in parts.items()}

    @torch.no_grad()
    def held_out(self, sample: int = 64) -> dict[str, float]:
        """The losses of the averaged networks on held-out takes, with recorded steps before each move."""
        if not len(self.held_starts):
            return {}
        picked = torch.linspace(0, len(self.held_starts) - 1, min(sample, len(self.held_starts))).long()
        truth = self.held_rows[self.held_starts[picked][:, None] + torch.arange(self._length)]
        with torch.random.fork_rng():
            torch.manual_seed(0)
            parts = self._danced(self.averaged, truth, 0.0, 0.0, 0.0)
        return {name: float(part) for name, part in parts.items()}

    def state(self) -> dict[str, Any]:
        """Everything that a resumed training and improvising need."""
        return {
            **self._shared_state(),
            "settings": asdict(self.settings),
            "shape": asdict(self.improviser.shape),
        }

    @property
    def _length(self) -> int:
        return BEFORE + self.settings.moves * MOVE

    def _danced(
        self, improviser: Improviser, truth: Tensor, own: float, dropout: float, noise: float
    ) -> dict[str, Tensor]:
        """Losses over rows (B, 3 + 8 * moves, inside).

        own: share of moves that continue the networks' own steps (scheduled sampling). The code of such a
        move leads from there back to the recording, so that correcting is learned too.
        """
        moves, choreographer = improviser.moves, improviser.choreographer
        state = choreographer.start(len(truth))
        mixture = None
        sums = {"moves": truth.new_zeros(()), "divergence": truth.new_zeros(()), "nats": truth.new_zeros(())}
        made = truth[:, :BEFORE]
        for number in range(self.settings.moves):
            at = BEFORE + number * MOVE
            keep = torch.rand(len(truth), 1, 1) < own
            before = torch.where(keep, made[:, -BEFORE:], truth[:, at - BEFORE : at])
            before = before + noise * torch.rand(len(truth), 1, 1) * torch.randn_like(before)
            move = truth[:, at : at + MOVE]
            mean, log_variance = moves.encode(before, move)
            code = sampled(mean, log_variance)
            if mixture is not None:
                sums["nats"] = sums["nats"] + mixture.negative_log_likelihood(code.detach()).mean()
            made = moves.decode(before, code)
            sums["moves"] = sums["moves"] + move_loss(made, move, before, improviser.scale.importance)
            sums["divergence"] = sums["divergence"] + divergence(mean, log_variance)
            mixture, state = choreographer(made[:, -BEFORE:].detach(), code.detach(), state, dropout)
        return {name: value / (self.settings.moves - (name == "nats")) for name, value in sums.items()}


def laid_out(stretches: Sequence[Tensor], scale: Scale, length: int) -> tuple[Tensor, Tensor]:
    """All scaled steps (N, inside) of stretches (T, features), and where a row of `length` steps begins."""
    starts, at = [], 0
    for stretch in stretches:
        starts.append(torch.arange(at, at + max(len(stretch) - length + 1, 0)))
        at += len(stretch)
    if not starts:
        return torch.zeros(0, scale.shape.inside), torch.zeros(0, dtype=torch.long)
    return scale.inside(torch.cat(list(stretches))), torch.cat(starts)


def load_improviser(path: Path) -> tuple[Improviser, dict[str, Any]]:
    """The averaged networks of a checkpoint and the whole state."""
    state = torch.load(path, map_location="cpu", weights_only=True)
    settings = state["settings"]
    improviser = Improviser(
        MovesShape(**state["shape"]), settings["lstm_width"], settings["lstm_layers"], settings["mixtures"]
    )
    improviser.load_state_dict(state["averaged"])
    return improviser.requires_grad_(False), state
