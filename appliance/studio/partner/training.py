"""Trains a partner: to tell the move that a dancer danced with another from moves danced without.

Two encoders, of what the other one has danced and of a move; their product is a move's score. The loss is
InfoNCE (Oord et al. 2018): the own move among 12 that the improviser could have danced at that moment, and
among the moves of other moments.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from appliance.dancer.material.improvising import BEFORE
from appliance.dancer.material.partner_network import LED_STEPS, SEEN
from appliance.studio.improviser.improviser import Mixture
from appliance.studio.partner.couples import Moments

BATCH, EMBEDDING, NOISE, DECAY, RATE = 256, 32, 0.3, 0.1, 1e-3
BEFORE_NOISE = 0.5  # on the steps before a move: on the stage they are its own, not recorded
NARROWEST_ANSWER = math.log(0.2)
LOOK_EVERY = 100  # steps between two looks at the take that is kept apart


class Scorer(nn.Module):
    """Scores of moves (N, C, 11, F) as answers to steps of another dancer (N, 16, F)."""

    def __init__(self, features: int, width: int = 256, dropped: float = 0.4) -> None:
        super().__init__()
        self.middle: Tensor
        self.scale: Tensor
        self.register_buffer("middle", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))
        self.of_led = _encoder(LED_STEPS * features, width, dropped)
        self.of_move = _encoder(SEEN * features, width, dropped)

    def learn_scale(self, led: Tensor) -> None:
        """Set middle and scale from steps (N, T, F)."""
        flat = led.flatten(0, 1)
        self.middle.copy_(flat.mean(0))
        self.scale.copy_(1 / flat.std(0).clamp_min(1e-3))

    def led(self, led: Tensor) -> Tensor:
        """(N, 16, F) -> (N, 32)."""
        out: Tensor = self.of_led(((led - self.middle) * self.scale).flatten(1))
        return out

    def move(self, moves: Tensor) -> Tensor:
        """(..., 11, F) -> (..., 32)."""
        out: Tensor = self.of_move(((moves - self.middle) * self.scale).flatten(-2))
        return out

    def forward(self, led: Tensor, moves: Tensor) -> Tensor:
        scores: Tensor = torch.einsum("ne,nce->nc", self.led(led), self.move(moves)) / EMBEDDING**0.5
        return scores


class Answers(nn.Module):
    """A dancer's last steps (N, 3, F) and those of the other one (N, 16, F) -> the numbers of the mixture of
    its next move's code.
    """

    def __init__(self, features: int, code: int, mixtures: int = 8, width: int = 384, dropped: float = 0.4):
        super().__init__()
        self.middle: Tensor
        self.scale: Tensor
        self.register_buffer("middle", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))
        self.mixtures = mixtures
        self.network = nn.Sequential(
            nn.Dropout(dropped / 2),
            nn.Linear((BEFORE + LED_STEPS) * features, width),
            nn.ELU(),
            nn.Dropout(dropped),
            nn.Linear(width, width),
            nn.ELU(),
            nn.Dropout(dropped),
            nn.Linear(width, mixtures * (2 * code + 1)),
        )

    def forward(self, before: Tensor, led: Tensor) -> Tensor:
        seen = torch.cat([before, led], 1)
        out: Tensor = self.network(((seen - self.middle) * self.scale).flatten(1))
        return out


def train_answers(
    training: Moments,
    apart: Moments,
    seconds: float,
    steps: int,
    device: str = "cpu",
    seed: int = 1,
    told: Callable[[str], None] = lambda words: None,
) -> tuple[Answers, float, float]:
    """The network; of moments kept apart the negative log likelihood of the codes that were danced, with the
    couple's steps and with another moment's, nats a number.
    """
    torch.manual_seed(seed)
    led, moves, codes = (torch.tensor(np.asarray(part, np.float32)).to(device) for part in training[:3])
    before = moves[:, 0, :BEFORE]
    answers = Answers(led.shape[-1], codes.shape[-1]).to(device)
    flat = led.flatten(0, 1)
    answers.middle.copy_(flat.mean(0))
    answers.scale.copy_(1 / flat.std(0).clamp_min(1e-3))
    average = copy.deepcopy(answers)
    descent = _Descent(answers, average, seconds, steps)
    best, least, least_other = copy.deepcopy(answers), math.inf, math.inf
    while descent.goes_on():
        chosen = torch.randint(len(led), (BATCH,), device=device)
        seen = [
            part[chosen] + noise * torch.randn_like(part[chosen]) / answers.scale
            for part, noise in ((before, BEFORE_NOISE), (led, NOISE))
        ]
        mixture = Mixture.of(answers(*seen), answers.mixtures, NARROWEST_ANSWER)
        loss = mixture.negative_log_likelihood(codes[chosen]).mean()
        step = descent.learn(loss)
        if step % LOOK_EVERY == 0:
            nats, other = nats_of(average, apart, device)
            told(
                f"step {step}: loss {float(loss.detach()):.3f}; kept apart: {nats:.3f} nats, {other:.3f} "
                "with another moment's steps"
            )
            if nats < least:
                best, least, least_other = copy.deepcopy(average), nats, other
    return best.cpu().eval(), least, least_other


class _Descent:
    """Learns a network until its time or its steps are over: the rate rises in 100 steps and then falls.

    average: becomes the network's running mean, which is what is looked at and kept.
    """

    def __init__(self, network: nn.Module, average: nn.Module, seconds: float, steps: int) -> None:
        self._network, self._average, self._seconds, self._steps = network, average, seconds, steps
        self._optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
        self._began, self._step = time.monotonic(), 0

    def goes_on(self) -> bool:
        """Whether another step is due; its rate is set."""
        gone = (time.monotonic() - self._began) / self._seconds
        if self._step >= self._steps or gone >= 1:
            return False
        for group in self._optimizer.param_groups:
            rise, fall = (self._step + 1) / 100, 1 - max(gone, self._step / self._steps)
            group["lr"] = RATE * min(1.0, rise) * max(0.02, fall)
        return True

    def learn(self, loss: torch.Tensor) -> int:
        """A step down this loss; how many that makes."""
        self._optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()
        self._step += 1
        with torch.no_grad():
            _follow(self._average, self._network, self._step)
        return self._step


def _follow(average: nn.Module, network: nn.Module, step: int) -> None:
    """The mean of the weights of some 200 steps."""
    for mean, own in zip(average.parameters(), network.parameters(), strict=True):
        mean.lerp_(own, 1 - min(0.995, step / (step + 10)))


@torch.no_grad()
def nats_of(answers: Answers, moments: Moments, device: str = "cpu") -> tuple[float, float]:
    """Negative log likelihood of the moves' codes with the couple's steps, and with another moment's."""
    answers.eval()
    led, moves, codes = (torch.tensor(np.asarray(part, np.float32)).to(device) for part in moments[:3])
    found = [
        float(
            Mixture.of(answers(moves[:, 0, :BEFORE], steps), answers.mixtures, NARROWEST_ANSWER)
            .negative_log_likelihood(codes)
            .mean()
        )
        for steps in (led, led.roll(len(led) // 3, 0))
    ]
    return found[0], found[1]


def _encoder(size: int, width: int, dropped: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Dropout(dropped / 2),
        nn.Linear(size, width),
        nn.ELU(),
        nn.Dropout(dropped),
        nn.Linear(width, width // 2),
        nn.ELU(),
        nn.Dropout(dropped),
        nn.Linear(width // 2, EMBEDDING),
    )


@dataclass
class Learned:
    """The best scorer, and of moments kept apart: how often it finds the move that was danced (chance 1/13),
    and how often it does with the steps of another moment in place of the couple's.
    """

    scorer: Scorer
    found: float = 0.0
    found_shuffled: float = 0.0
    step: int = 0
    history: list[tuple[int, float, float, float]] = field(default_factory=list)


def train(
    training: Moments,
    apart: Moments,
    seconds: float,
    steps: int,
    device: str = "cpu",
    seed: int = 1,
    told: Callable[[str], None] = lambda words: None,
) -> Learned:
    """Train until the time or the steps are over; the scorer of the best look at `apart` is given."""
    torch.manual_seed(seed)
    led, moves = (torch.tensor(np.asarray(part, np.float32)).to(device) for part in training[:2])
    scorer = Scorer(led.shape[-1]).to(device)
    scorer.learn_scale(led)
    average = copy.deepcopy(scorer)
    descent = _Descent(scorer, average, seconds, steps)
    learned = Learned(copy.deepcopy(average))
    while descent.goes_on():
        chosen = torch.randint(len(led), (BATCH,), device=device)
        noisy = led[chosen] + NOISE * torch.randn_like(led[chosen]) / scorer.scale
        seen = moves[chosen] + NOISE * torch.randn_like(moves[chosen]) / scorer.scale
        of_led, of_moves = scorer.led(noisy), scorer.move(seen)
        among = torch.einsum("ne,nce->nc", of_led, of_moves) / EMBEDDING**0.5
        across = of_led @ of_moves[:, 0].T / EMBEDDING**0.5
        alike = torch.arange(BATCH, device=device)
        other = torch.einsum("ne,nce->nc", of_led.roll(1, 0), of_moves) / EMBEDDING**0.5
        none = torch.full_like(other, 1 / other.shape[1])  # with another's steps no move is better
        loss = (
            functional.cross_entropy(among, torch.zeros_like(alike))
            + 0.5 * functional.cross_entropy(across, alike)
            + 0.5 * functional.cross_entropy(other, none)
        )
        step = descent.learn(loss)
        if step % LOOK_EVERY == 0:
            found, shuffled = found_of(average, apart, device)
            learned.history.append((step, float(loss.detach()), found, shuffled))
            told(
                f"step {step}: loss {float(loss.detach()):.3f}; kept apart: finds {100 * found:.1f} % of the "
                f"moves, {100 * shuffled:.1f} % with another moment's steps"
            )
            if found - shuffled > learned.found - learned.found_shuffled:
                learned.scorer, learned.found = copy.deepcopy(average).cpu().eval(), found
                learned.found_shuffled, learned.step = shuffled, step
    learned.scorer.cpu().eval()
    return learned


@torch.no_grad()
def found_of(scorer: Scorer, moments: Moments, device: str = "cpu") -> tuple[float, float]:
    """Shares of moments whose own move scores highest: with the couple's steps, and with another moment's."""
    was = scorer.training
    scorer.eval()
    led, moves = (torch.tensor(np.asarray(part, np.float32)).to(device) for part in moments[:2])
    of_moves = scorer.move(moves)
    shares = []
    for steps in (led, led.roll(len(led) // 3, 0)):
        scores = torch.einsum("ne,nce->nc", scorer.led(steps), of_moves)
        shares.append(float((scores.argmax(1) == 0).float().mean()))
    scorer.train(was)
    return shares[0], shares[1]
