"""Couples: two recordings of one take, as steps of an improviser; the moments that a partner learns from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import BEFORE, MOVE, Numbers
from appliance.dancer.material.partner_network import GAP, LED_STEPS, SEEN
from appliance.dancer.material.steps import HOP, steps_of
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, Dataset, Take
from appliance.studio.data.jumps import runs
from appliance.studio.data.mirror import mirrored

FIRST = LED_STEPS + GAP  # steps before the first moment
DANCED = 4  # steps of a move until the next one
_EVERY = 2  # recorded steps from one moment to the next
_ASTRAY = (0.5, 1.0)  # noise on the codes of moves that lead away from a recording, in deviations
_AT_ONCE = 2048


class Stretch(NamedTuple):
    """A dancer's steps (T, F), and the other's of the couple at the same moments; None where that one was not
    recorded soundly. who: see PartnerNetwork. take: its number.
    """

    own: Numbers
    led: Numbers | None
    who: int
    take: int


class Moments(NamedTuple):
    """N moments: what the other one had danced (N, 16, F), heard (N,): whether it is known; the dancer's own
    steps before (N, 11, F), the recorded move after them (N, 8, F) and its code (N, C); who (N,); takes (N,);
    recorded (N,): whether its own steps are.
    """

    led: NDArray[np.float16]
    heard: NDArray[np.bool_]
    own: NDArray[np.float16]
    move: NDArray[np.float16]
    codes: Numbers
    who: NDArray[np.int_]
    takes: NDArray[np.int_]
    recorded: NDArray[np.bool_]


def couples_of(takes: Sequence[Take]) -> dict[str, tuple[Take, Take]]:
    """Both recordings of each take that has two, from their beginnings on, as long as the shorter one."""
    found: dict[str, list[Take]] = {}
    for take in takes:
        found.setdefault(take.take, []).append(take)
    couples = {}
    for name, both in found.items():
        if len(both) == 2:
            least = min(len(one.recording) for one in both)
            first, second = (one if len(one.recording) == least else one.part(0, least) for one in both)
            couples[name] = first, second
    return couples


def stretches_of(network: ImproviserNetwork, dataset: Dataset, takes: Sequence[Take]) -> list[Stretch]:
    """Sound stretches of all couples among the takes, of either dancer, and in the mirror."""
    found = []
    for number, both in enumerate(couples_of(takes).values()):
        sound = [take.sound for take in both]
        for start, end in runs(sound[0] & sound[1]):
            for mirror, pair in _recorded(both, start, end, dataset.mirrors):
                steps = [steps_of(network, one, dataset.moving).features for one in pair]
                for own, led in permutations((0, 1)):
                    found.append(Stretch(steps[own], steps[led], own + 2 * mirror, number))
        for own in (0, 1):
            for start, end in runs(sound[own] & ~sound[1 - own]):
                for mirror, (one,) in _recorded(both[own : own + 1], start, end, dataset.mirrors):
                    steps_alone = steps_of(network, one, dataset.moving).features
                    found.append(Stretch(steps_alone, None, own + 2 * mirror, number))
    return [stretch for stretch in found if len(stretch.own) >= FIRST + MOVE + 1]


def _recorded(
    takes: Sequence[Take], start: int, end: int, mirrors: bool
) -> Iterator[tuple[int, list[Recording]]]:
    both = [take.recording.excerpt(start / FPS, end / FPS) for take in takes]
    for shift in range(HOP):
        shifted = [one.without_first(shift) for one in both]
        yield 0, shifted
        if mirrors:
            yield 1, [mirrored(one) for one in shifted]


def moments_of(network: ImproviserNetwork, stretches: Sequence[Stretch], rng: np.random.Generator) -> Moments:
    """Moments of the recordings; and of dances that go astray from them, whose next move leads back."""
    rows = []
    for stretch in stretches:
        rows += [(stretch, stretch.own, at) for at in range(FIRST, len(stretch.own) - MOVE, _EVERY)]
    for astray in _ASTRAY:
        for begin in range(0, DANCED, _EVERY):
            rows += list(_astray(network, stretches, begin, astray, rng))
    own = np.stack([made[at - SEEN : at] for _, made, at in rows]).astype(np.float16)
    move = np.stack([stretch.own[at : at + MOVE] for stretch, _, at in rows]).astype(np.float16)
    led = np.stack([led_of(stretch, at) for stretch, _, at in rows]).astype(np.float16)
    codes = [
        network.code_of(own[some, -BEFORE:].astype(np.float32), move[some].astype(np.float32))
        for some in (slice(at, at + _AT_ONCE) for at in range(0, len(rows), _AT_ONCE))
    ]
    return Moments(
        led,
        np.array([stretch.led is not None for stretch, _, _ in rows]),
        own,
        move,
        np.concatenate(codes),
        np.array([stretch.who for stretch, _, _ in rows]),
        np.array([stretch.take for stretch, _, _ in rows]),
        np.array([made is stretch.own for stretch, made, _ in rows]),
    )


def led_of(stretch: Stretch, at: int) -> Numbers:
    """The other one's dance (16, F) before the step; 0 where it is not known."""
    if stretch.led is None:
        return np.zeros((LED_STEPS, stretch.own.shape[1]), np.float32)
    return stretch.led[at - FIRST : at - GAP]


def together(stretches: Sequence[Stretch], begin: int) -> Iterator[tuple[int, list[int]]]:
    """Each step at which moves begin, and the numbers of the stretches that have one there."""
    for at in range(FIRST + begin, max(len(one.own) for one in stretches) - MOVE, DANCED):
        yield at, [n for n, one in enumerate(stretches) if at + MOVE < len(one.own)]


def _astray(
    network: ImproviserNetwork,
    stretches: Sequence[Stretch],
    begin: int,
    astray: float,
    rng: np.random.Generator,
) -> Iterable[tuple[Stretch, Numbers, int]]:
    """Each dance that follows a stretch on and off, with where a move of it begins."""
    dances = [stretch.own.copy() for stretch in stretches]
    for at, some in together(stretches, begin):
        before = np.stack([dances[n][at - BEFORE : at] for n in some])
        codes = network.code_of(before, np.stack([stretches[n].own[at : at + MOVE] for n in some]))
        codes += astray * rng.standard_normal(codes.shape).astype(np.float32)
        for n, move in zip(some, network.move_of(before, codes), strict=True):
            dances[n][at : at + DANCED] = move[:DANCED]
            yield stretches[n], dances[n], at
