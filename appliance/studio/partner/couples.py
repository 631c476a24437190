"""Couples: two recordings of one take, as steps of an improviser, and moves drawn beside their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import BEFORE, MOVE, Numbers, drawn, parts_of
from appliance.dancer.material.partner_network import GAP, LED_STEPS
from appliance.dancer.material.steps import HOP, steps_of
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, Dataset, Take
from appliance.studio.data.jumps import runs
from appliance.studio.data.mirror import mirrored

DRAWN = 12  # other moves at each moment
FIRST = LED_STEPS + GAP  # steps before the first moment
_EVERY = 2  # steps from one moment to the next
_AT_ONCE = 512


class Moments(NamedTuple):
    """N moments of couples: what one dancer had danced (N, 16, F), and moves of the other, each with the 3
    steps before it (N, 1 + 12, 11, F): its own, then others that its improviser could have danced there.

    codes (N, C): its moves. takes (N,): numbers of the takes.
    """

    led: Numbers
    moves: Numbers
    codes: Numbers
    takes: Numbers


def couples_of(takes: Sequence[Take]) -> dict[str, tuple[Take, Take]]:
    """Both recordings of each take that has two."""
    found: dict[str, list[Take]] = {}
    for take in takes:
        found.setdefault(take.take, []).append(take)
    return {name: (both[0], both[1]) for name, both in found.items() if len(both) == 2}


def moments_of(
    network: ImproviserNetwork, dataset: Dataset, takes: Sequence[Take], rng: np.random.Generator
) -> Moments:
    """Moments of all couples among the takes, either dancer as the one that answers, and in the mirror."""
    led, moves, codes, names = [], [], [], []
    for number, (first, second) in enumerate(couples_of(takes).values()):
        for start, end in runs(first.sound & second.sound):
            for both in _recorded(first, second, start, end, dataset.mirrors):
                steps = [steps_of(network, one, dataset.moving).features for one in both]
                if len(steps[0]) < FIRST + MOVE + 1:
                    continue
                for one, other in permutations(steps):
                    moments, found, own = _moves(network, other, rng)
                    led.append(np.stack([one[at - FIRST : at - GAP] for at in moments]))
                    moves.append(found)
                    codes.append(own)
                    names += [number] * len(moments)
    return Moments(np.concatenate(led), np.concatenate(moves), np.concatenate(codes), np.array(names))


def _recorded(first: Take, second: Take, start: int, end: int, mirrors: bool) -> Iterator[list[Recording]]:
    both = [take.recording.excerpt(start / FPS, end / FPS) for take in (first, second)]
    for shift in range(0, HOP, 2):
        shifted = [one.without_first(shift) for one in both]
        yield shifted
        if mirrors:
            yield [mirrored(one) for one in shifted]


def _moves(
    network: ImproviserNetwork, steps: Numbers, rng: np.random.Generator
) -> tuple[list[int], Numbers, Numbers]:
    """Moments; (N, 1 + 12, 11, F): the recorded move as the networks give it, and moves drawn there; and
    the codes (N, C) of the recorded ones.
    """
    moments = list(range(FIRST, len(steps) - MOVE, _EVERY))
    cells = np.zeros((MOVE // _EVERY, network.cells), np.float32)  # a memory for each beginning of moves
    found, recorded = [], []
    for number, at in enumerate(moments):
        chain = number % len(cells)
        code = network.code_of(steps[None, at - MOVE - BEFORE : at - MOVE], steps[None, at - MOVE : at])
        before = steps[None, at - BEFORE : at]
        mixture, cells[chain : chain + 1] = network.forecast(before, code, cells[chain : chain + 1])
        logits, means, scales = (np.repeat(part, DRAWN, 0) for part in parts_of(mixture, network.mixtures))
        own = network.code_of(before, steps[None, at : at + MOVE])
        recorded.append(own)
        codes = np.concatenate([own, drawn(logits, means, scales, 1.0, rng)])
        repeated = np.repeat(before, len(codes), 0)
        found.append(np.concatenate([repeated, network.move_of(repeated, codes)], 1).astype(np.float16))
    return moments, np.stack(found), np.concatenate(recorded)
