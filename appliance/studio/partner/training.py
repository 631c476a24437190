"""Trains a partner: to dance as one of a couple, after the other one or by itself, and to know an answer.

Four networks, in this order. Answers: codes of the next move. Then it dances along the recorded
takes, and Natural learns to tell its moves from the dancer's: the logarithm of a ratio of densities, by which
moves are drawn anew on the stage. Scorer: which move answers? Its loss is InfoNCE (Oord et al. 2018), the
own move among 12 that Answers could have danced at that moment without the other one, and among the moves of
other moments. Alike: which of the dancers is this?
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import BEFORE, Numbers
from appliance.dancer.material.partner_network import LED_STEPS, SEEN
from appliance.studio.partner.couples import DANCED, Moments, Stretch, led_of, moments_of, together

BATCH, EMBEDDING, NOISE, DECAY, RATE = 256, 32, 0.3, 0.1, 1e-3
OWN_NOISE, WIDTH, DROPPED = 0.6, 512, 0.5  # for Answers
ALONE = 0.3  # share of the moments at which the other one is not heard
OTHERS = 12  # moves drawn at a moment
_MOST = 12_000  # moments for which they are
TIMES, FLOW_STEPS, DEEP = 4, 6, (192, 192, 192)  # for the flow
LOOK_EVERY = 100  # steps between two looks at the take that is kept apart
Report = Callable[[str], None]
Side = tuple[Tensor, Tensor]  # moves with the steps before them (N, 11, F), and who (N, W)
N = TypeVar("N", bound=nn.Module)


class Scale(nn.Module):
    """Steps (..., T, F) -> (..., T * F), standardised."""

    def __init__(self, features: int) -> None:
        super().__init__()
        self.middle: Tensor
        self.scale: Tensor
        self.register_buffer("middle", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))

    def learn(self, steps: Tensor) -> None:
        """Set both from steps (N, T, F)."""
        flat = steps.flatten(0, 1)
        self.middle.copy_(flat.mean(0))
        self.scale.copy_(1 / flat.std(0).clamp_min(1e-3))

    def forward(self, steps: Tensor) -> Tensor:
        out: Tensor = ((steps - self.middle) * self.scale).flatten(-2)
        return out

    def shaken(self, steps: Tensor, noise: float) -> Tensor:
        """Steps with noise, in their deviations."""
        return steps + noise * torch.randn_like(steps) / self.scale


class Scorer(nn.Module):
    """Scores of moves (N, C, 11, F) as answers to steps of another dancer (N, 16, F)."""

    def __init__(self, features: int, width: int = 256, dropped: float = 0.4) -> None:
        super().__init__()
        self.scale = Scale(features)
        self.of_led = _dense(LED_STEPS * features, width, width // 2, EMBEDDING, dropped)
        self.of_move = _dense(SEEN * features, width, width // 2, EMBEDDING, dropped)

    def led(self, led: Tensor) -> Tensor:
        """(N, 16, F) -> (N, 32)."""
        out: Tensor = self.of_led(self.scale(led))
        return out

    def move(self, moves: Tensor) -> Tensor:
        """(..., 11, F) -> (..., 32)."""
        out: Tensor = self.of_move(self.scale(moves))
        return out

    def forward(self, led: Tensor, moves: Tensor) -> Tensor:
        scores: Tensor = torch.einsum("ne,nce->nc", self.led(led), self.move(moves)) / EMBEDDING**0.5
        return scores


class Answers(nn.Module):
    """Codes of moves (N, C) from noise (N, C), by flow matching (Lipman et al. 2023), after a dancer's last
    steps (N, 11, F), those of the other one (N, 16, F), which dancer it is (N, W) and whether the other one
    is heard (N, 1); one row of these serves all noise.
    """

    def __init__(
        self, features: int, code: int, dancers: int, width: int = WIDTH, dropped: float = DROPPED
    ) -> None:
        super().__init__()
        self.scale, self.dancers, self.code = Scale(features), dancers, code
        size = (SEEN + LED_STEPS) * features + dancers + 1
        self.context = _dense(size, width, width, width, dropped)
        sizes = (code, *DEEP)
        self.steps = nn.ModuleList([nn.Linear(into, out, bias=False) for into, out in pairwise(sizes)])
        self.conditions = nn.ModuleList([nn.Linear(width, out) for out in DEEP])
        self.when = nn.ModuleList([nn.Linear(TIMES, out, bias=False) for out in DEEP])
        self.last = nn.Linear(DEEP[-1], code)

    def seen(self, own: Tensor, led: Tensor, who: Tensor, heard: Tensor) -> Tensor:
        """The flow's inputs (N, width)."""
        out: Tensor = self.context(torch.cat([self.scale(own), self.scale(led) * heard, who, heard], 1))
        return functional.elu(out)

    def way(self, codes: Tensor, time: Tensor, seen: Tensor) -> Tensor:
        """Where codes (N, C) flow at a time (N, 1) or (1, 1), 0..1."""
        hidden, times = codes, times_of(time)
        for step, condition, when in zip(self.steps, self.conditions, self.when, strict=True):
            hidden = functional.elu(step(hidden) + condition(seen) + when(times))
        out: Tensor = self.last(hidden)
        return out

    def forward(self, own: Tensor, led: Tensor, who: Tensor, heard: Tensor, noise: Tensor) -> Tensor:
        seen, codes = self.seen(own, led, who, heard), noise
        for number in range(FLOW_STEPS):
            time = torch.full((1, 1), number / FLOW_STEPS, device=noise.device)
            codes = codes + self.way(codes, time, seen) / FLOW_STEPS
        return codes

    def error(self, moments: _Batch, heard: Tensor, noise: Tensor, time: Tensor) -> Tensor:
        """Mean squared error of where the flow leads from noise to the recorded codes."""
        seen = self.seen(moments.own, moments.led, moments.who, heard)
        between = (1 - time) * noise + time * moments.codes
        return (self.way(between, time, seen) - (moments.codes - noise)).square().mean()


def times_of(time: Tensor) -> Tensor:
    """(N, 1), 0..1 -> (N, 4)."""
    return torch.cat([time, time.square(), torch.cos(math.pi * time), torch.sin(math.pi * time)], 1)


class Natural(nn.Module):
    """Moves with the steps before them (N, 11, F), which dancer (N, W) -> the logarithm (N,) of how much
    likelier they are the dancer's than the partner's.
    """

    def __init__(self, features: int, dancers: int, width: int = 256, dropped: float = 0.4) -> None:
        super().__init__()
        self.scale = Scale(features)
        self.network = _dense(SEEN * features + dancers, width, width // 2, 1, dropped)

    def forward(self, moves: Tensor, who: Tensor) -> Tensor:
        out: Tensor = self.network(torch.cat([self.scale(moves), who], 1))[:, 0]
        return out


class Alike(nn.Module):
    """Steps (N, 11, F) -> logits (N, W) of which dancer this is."""

    def __init__(self, features: int, dancers: int, width: int = 64, dropped: float = 0.4) -> None:
        super().__init__()
        self.scale = Scale(features)
        self.network = _dense(SEEN * features, width, width, dancers, dropped)

    def forward(self, steps: Tensor) -> Tensor:
        out: Tensor = self.network(self.scale(steps))
        return out


class Partner(NamedTuple):
    """The content of partner.onnx."""

    answers: Answers
    natural: Natural
    scorer: Scorer
    alike: Alike


class _Batch(NamedTuple):
    """Moments on a device, see Moments; who (N, W), heard and recorded (N, 1)."""

    led: Tensor
    heard: Tensor
    own: Tensor
    move: Tensor
    codes: Tensor
    who: Tensor
    recorded: Tensor

    @property
    def whole(self) -> Tensor:
        """The recorded move with the 3 steps before it, (N, 11, F)."""
        return torch.cat([self.own[:, -BEFORE:], self.move], 1)

    def rows(self, chosen: Tensor | slice) -> _Batch:
        return _Batch(*(part[chosen].float() for part in self))


def train(
    network: ImproviserNetwork,
    stretches: Sequence[Stretch],
    apart: Sequence[Stretch],
    dancers: int,
    seconds: float,
    steps: int,
    device: str = "cpu",
    seed: int = 1,
    report: Report = lambda message: None,
) -> Partner:
    """All networks within the seconds, or with so many steps each; the best on the stretches kept apart."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    descent = _Descent(steps, report)
    began = time.monotonic()
    learned, asked = (_moved(moments_of(network, part, rng), dancers, device) for part in (stretches, apart))
    seconds = max(seconds - (time.monotonic() - began), 1.0)
    answers = train_answers(learned, asked, descent.within(0.45 * seconds, "answers"))
    danced, danced_apart = (dances(network, answers, part, rng, device) for part in (stretches, apart))
    natural = train_natural(learned, asked, danced, danced_apart, descent.within(0.2 * seconds, "natural"))
    beside, beside_apart = (others(network, answers, part, rng, device) for part in (learned, asked))
    scorer = train_scorer(beside, beside_apart, descent.within(0.3 * seconds, "scores"))
    alike = train_alike(learned, asked, descent.within(0.05 * seconds, "alike"))
    return Partner(answers, natural, scorer, alike)


def train_answers(training: _Batch, apart: _Batch, descent: _Descent) -> Answers:
    """The network of the least error on the moves that were danced."""
    answers = Answers(training.own.shape[-1], training.codes.shape[-1], training.who.shape[1])
    answers.scale.learn(training.own.float())
    answers.to(training.own.device)

    def loss_of(network: Answers) -> Tensor:
        some = training.rows(_some(training.own))
        heard = some.heard * (torch.rand_like(some.heard) >= ALONE)
        scale = network.scale
        shaken = some._replace(own=scale.shaken(some.own, OWN_NOISE), led=scale.shaken(some.led, NOISE))
        time = torch.rand_like(heard)
        return network.error(shaken, heard, torch.randn_like(some.codes), time)

    def look(network: Answers) -> tuple[float, str]:
        own, other, alone = errors_of(network, apart)
        return own, f"error {own:.3f}; {other:.3f} with another moment's steps, {alone:.3f} alone"

    return descent.learn(answers, loss_of, look, keeps_last=True)


@torch.no_grad()
def errors_of(answers: Answers, moments: _Batch) -> tuple[float, float, float]:
    """Errors on the moves: with the couple's steps, with another moment's, and with nobody's."""
    every = slice(None, None, max(1, len(moments.own) // 4096))
    known = moments.rows(every)
    is_heard = known.heard[:, 0] > 0
    some = _Batch(*(part[is_heard] for part in known))
    wrong = some._replace(led=some.led.roll(len(some.led) // 3, 0))
    generator = torch.Generator().manual_seed(1)
    noise = torch.randn(some.codes.shape, generator=generator).to(some.codes.device)
    time = torch.rand(some.heard.shape, generator=generator).to(some.codes.device)
    found = [
        float(answers.error(one, heard, noise, time))
        for one, heard in ((some, some.heard), (wrong, some.heard), (some, 0 * some.heard))
    ]
    return found[0], found[1], found[2]


def train_natural(
    training: _Batch,
    apart: _Batch,
    danced: Side,
    danced_apart: Side,
    descent: _Descent,
) -> Natural:
    """danced: moves with the steps before them (N, 11, F), and who (N, W), as `dances` gives them."""
    natural = Natural(training.own.shape[-1], training.who.shape[1])
    natural.scale.learn(training.own.float())
    natural.to(training.own.device)
    recorded = [(one.whole, one.who) for one in map(_recorded, (training, apart))]

    def of(network: Natural, real: Side, made: Side, noise: float) -> Tensor:
        scores = [network(network.scale.shaken(moves.float(), noise), who) for moves, who in (real, made)]
        return (functional.softplus(-scores[0]).mean() + functional.softplus(scores[1]).mean()) / 2

    def loss_of(network: Natural) -> Tensor:
        sides = []
        for moves, who in (recorded[0], danced):
            chosen = _some(moves)
            sides.append((moves[chosen], who[chosen]))
        return of(network, sides[0], sides[1], NOISE)

    def look(network: Natural) -> tuple[float, str]:
        with torch.no_grad():
            found = float(of(network, recorded[1], danced_apart, 0.0))
        return found, f"tells its moves from the dancer's: {found:.3f} nats (chance {math.log(2):.3f})"

    return descent.learn(natural, loss_of, look)


def train_scorer(training: tuple[_Batch, Tensor], apart: tuple[_Batch, Tensor], descent: _Descent) -> Scorer:
    """training, apart: moments, and moves at each with the steps before them, the own one first
    (N, 1 + 12, 11, F), as `others` gives them.
    """
    moments, moves = training
    scorer = Scorer(moves.shape[-1])
    scorer.scale.learn(moments.own.float())
    scorer.to(moves.device)

    def loss_of(network: Scorer) -> Tensor:
        chosen, scale = _some(moves), network.scale
        of_led = network.led(scale.shaken(moments.led[chosen].float(), NOISE))
        of_moves = network.move(scale.shaken(moves[chosen].float(), NOISE))
        among = torch.einsum("ne,nce->nc", of_led, of_moves) / EMBEDDING**0.5
        across = of_led @ of_moves[:, 0].T / EMBEDDING**0.5
        alike = torch.arange(len(chosen), device=moves.device)
        other = torch.einsum("ne,nce->nc", of_led.roll(1, 0), of_moves) / EMBEDDING**0.5
        none = torch.full_like(other, 1 / other.shape[1])  # with another's steps no move is better
        return (
            functional.cross_entropy(among, torch.zeros_like(alike))
            + 0.5 * functional.cross_entropy(across, alike)
            + 0.5 * functional.cross_entropy(other, none)
        )

    def look(network: Scorer) -> tuple[float, str]:
        found, shuffled = found_of(network, *apart)
        return shuffled - found, (
            f"finds {100 * found:.1f} % of the moves, {100 * shuffled:.1f} % with another moment's steps"
        )

    return descent.learn(scorer, loss_of, look)


@torch.no_grad()
def found_of(scorer: Scorer, moments: _Batch, moves: Tensor) -> tuple[float, float]:
    """Shares of moments whose own move scores highest: with the couple's steps, and with another moment's."""
    of_moves, led = scorer.move(moves.float()), moments.led.float()
    shares = []
    for steps in (led, led.roll(len(led) // 3, 0)):
        scores = torch.einsum("ne,nce->nc", scorer.led(steps), of_moves)
        shares.append(float((scores.argmax(1) == 0).float().mean()))
    return shares[0], shares[1]


def train_alike(training: _Batch, apart: _Batch, descent: _Descent) -> Alike:
    """The network that best tells the dancers."""
    alike = Alike(training.own.shape[-1], training.who.shape[1])
    alike.scale.learn(training.own.float())
    alike.to(training.own.device)

    def loss_of(network: Alike) -> Tensor:
        some = training.rows(_some(training.own))
        return functional.cross_entropy(network(network.scale.shaken(some.own, NOISE)), some.who.argmax(1))

    def look(network: Alike) -> tuple[float, str]:
        with torch.no_grad():
            scores, who = network(apart.own.float()), apart.who.argmax(1)
        found = float((scores.argmax(1) == who).float().mean())
        return float(functional.cross_entropy(scores, who)), f"knows {100 * found:.1f} % of the dancers"

    return descent.learn(alike, loss_of, look)


@torch.no_grad()
def dances(
    network: ImproviserNetwork,
    answers: Answers,
    stretches: Sequence[Stretch],
    rng: np.random.Generator,
    device: str,
) -> Side:
    """Moves that the partner dances beside the takes, with the steps before them (N, 11, F); who (N, W)."""
    own = [stretch.own.copy() for stretch in stretches]
    is_alone = rng.random(len(stretches)) < ALONE
    found, names = [], []
    for at, some in together(stretches, 0):
        seen = np.stack([own[n][at - SEEN : at] for n in some])
        led = np.stack([led_of(stretches[n], at) for n in some])
        who = np.array([stretches[n].who for n in some])
        heard = np.array([stretches[n].led is not None and not is_alone[n] for n in some])
        codes = _codes(answers, seen, led, who, heard, 1, rng, device)
        moves = network.move_of(seen[:, -BEFORE:], codes)
        for n, move in zip(some, moves, strict=True):
            own[n][at : at + DANCED] = move[:DANCED]
        found.append(np.concatenate([seen[:, -BEFORE:], moves], 1).astype(np.float16))
        names.append(who)
    return _tensor(np.concatenate(found), device), _one_hot(np.concatenate(names), answers.dancers, device)


@torch.no_grad()
def others(
    network: ImproviserNetwork, answers: Answers, moments: _Batch, rng: np.random.Generator, device: str
) -> tuple[_Batch, Tensor]:
    """Some of the moments whose other dancer is known; and moves there with the steps before them
    (N, 1 + 12, 11, F): the recorded one as the networks give it, and moves drawn without the other dancer.
    """
    known = (moments.heard * moments.recorded)[:, 0].nonzero()[:, 0].cpu().numpy()
    if len(known) > _MOST:
        known = np.sort(rng.choice(known, _MOST, replace=False))
    chosen = torch.from_numpy(known).to(device)
    kept = _Batch(*(part[chosen] for part in moments))
    found = []
    for first in range(0, len(known), 512):
        some = kept.rows(slice(first, first + 512))
        own, who = some.own.cpu().numpy(), some.who.argmax(1).cpu().numpy()
        codes = _codes(answers, own, 0 * some.led.cpu().numpy(), who, 0 * who, OTHERS, rng, device)
        codes = np.concatenate([some.codes.cpu().numpy()[:, None], codes.reshape(len(own), OTHERS, -1)], 1)
        before = np.repeat(own[:, -BEFORE:], 1 + OTHERS, 0)
        moves = np.concatenate([before, network.move_of(before, codes.reshape(len(before), -1))], 1)
        found.append(moves.reshape(len(own), 1 + OTHERS, SEEN, -1).astype(np.float16))
    return kept, _tensor(np.concatenate(found), device)


def _codes(
    answers: Answers,
    own: Numbers,
    led: Numbers,
    who: NDArray[np.int_],
    heard: NDArray[np.bool_] | NDArray[np.int_],
    count: int,
    rng: np.random.Generator,
    device: str,
) -> Numbers:
    """(N * count, C) drawn."""
    noise = rng.standard_normal((len(own) * count, answers.code)).astype(np.float32)
    given = (
        _tensor(own, device),
        _tensor(led, device),
        _one_hot(who, answers.dancers, device),
        _tensor(heard.astype(np.float32)[:, None], device),
    )
    repeated = (part.float().repeat_interleave(count, 0) for part in given)
    codes: Numbers = answers(*repeated, _tensor(noise, device)).cpu().numpy()
    return codes


def _moved(moments: Moments, dancers: int, device: str) -> _Batch:
    return _Batch(
        _tensor(moments.led, device),
        _tensor(moments.heard.astype(np.float32)[:, None], device),
        _tensor(moments.own, device),
        _tensor(moments.move, device),
        _tensor(moments.codes, device),
        _one_hot(moments.who, dancers, device),
        _tensor(moments.recorded.astype(np.float32)[:, None], device),
    )


def _recorded(moments: _Batch) -> _Batch:
    is_recorded = moments.recorded[:, 0] > 0
    return _Batch(*(part[is_recorded] for part in moments))


def _tensor(values: NDArray[np.floating], device: str) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values)).to(device)


def _one_hot(who: NDArray[np.int_], dancers: int, device: str) -> Tensor:
    return functional.one_hot(torch.from_numpy(who), dancers).float().to(device)


def _some(rows: Tensor) -> Tensor:
    return torch.randint(len(rows), (min(BATCH, len(rows)),), device=rows.device)


def _dense(size: int, width: int, narrow: int, out: int, dropped: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Dropout(dropped / 2),
        nn.Linear(size, width),
        nn.ELU(),
        nn.Dropout(dropped),
        nn.Linear(width, narrow),
        nn.ELU(),
        nn.Dropout(dropped),
        nn.Linear(narrow, out),
    )


class _Descent:
    """Learns networks, each until its time or its steps are over: the rate rises in 100 steps and then falls.

    A network's running mean is what is looked at, and kept where it is best.
    """

    def __init__(self, steps: int, report: Report) -> None:
        self._steps, self._report, self._seconds, self._name = steps, report, math.inf, ""

    def within(self, seconds: float, name: str) -> _Descent:
        """For the next network."""
        self._seconds, self._name = seconds, name
        return self

    def learn(
        self,
        network: N,
        loss_of: Callable[[N], Tensor],
        look: Callable[[N], tuple[float, str]],
        keeps_last: bool = False,
    ) -> N:
        """The running mean of the least value that `look` gave; with what it says."""
        average = copy.deepcopy(network).eval().requires_grad_(False)
        optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
        best, least, began, step = copy.deepcopy(average), math.inf, time.monotonic(), 0
        while step < self._steps and (gone := (time.monotonic() - began) / self._seconds) < 1:
            for group in optimizer.param_groups:
                fall = 1 - max(gone, step / self._steps)
                group["lr"] = RATE * min(1.0, (step + 1) / 100) * max(0.02, fall)
            loss = loss_of(network)
            optimizer.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
            step += 1
            with torch.no_grad():
                for mean, own in zip(average.parameters(), network.parameters(), strict=True):
                    mean.lerp_(own, 1 - min(0.995, step / (step + 10)))
            if step % LOOK_EVERY == 0:
                value, said = look(average)
                self._report(
                    f"{self._name}, step {step}: loss {float(loss.detach()):.3f}; kept apart: {said}"
                )
                if value < least:
                    best, least = copy.deepcopy(average), value
        was_seen = least < math.inf  # else the best is still the network that it began with
        return best if was_seen and not keeps_last else average
