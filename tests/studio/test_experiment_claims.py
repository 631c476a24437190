"""The paper's claims: what knows nothing fails them, what does as the paper says passes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.data.dataset import FPS, Take
from appliance.studio.evaluation.coders import Poses
from appliance.studio.experiments.claim_figures import chance, half_in, pauses
from appliance.studio.experiments.claims import Bound, Claim, claims, worth
from appliance.studio.experiments.excerpts import WHY
from appliance.studio.experiments.null_networks import (
    KINDS,
    Copy,
    Mean,
    NullNetwork,
    Paste,
    Untrained,
)
from tests.studio.excerpt_takes import JOINTS, Pausing, five_takes, trials, whole_skeleton


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    return five_takes(whole_skeleton())


@pytest.fixture(scope="module")
def mean() -> np.ndarray:
    """A mean pose that no excerpt stays at: 20 degrees from the rest pose."""
    pose = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.full(len(JOINTS), np.radians(20.0)))
    pose[0] = quaternion.IDENTITY
    return pose


def turned(degrees: np.ndarray) -> np.ndarray:
    """Poses (T, 1, 4) of one joint that turns."""
    return quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.radians(degrees))[:, None]


def test_pauses_and_jumps_are_counted() -> None:
    share, jump = pauses(turned(np.repeat([0.0, 10.0, 20.0, 30.0], 10)))  # four pauses, each left by one step
    assert share == pytest.approx(36 / 39)
    assert jump == 1
    share, jump = pauses(turned(np.linspace(0, 30, 40)))
    assert share == 0 and np.isnan(jump)


@pytest.mark.parametrize("share", [0.5, 0.1])
def test_neither_slowness_nor_smallness_is_a_pause_or_a_jump(share: float) -> None:
    time = np.arange(400) / FPS
    swing = 40 * np.sin(2 * np.pi * 0.6 * time) + 15 * np.sin(2 * np.pi * 1.7 * time)
    slow = np.interp(np.arange(0, 399, share), np.arange(400), swing)
    for other in (share * swing, slow):
        assert pauses(turned(other))[0] == pytest.approx(pauses(turned(swing))[0], abs=0.01)
        assert half_in(turned(other)) == pytest.approx(half_in(turned(swing)), rel=0.02)
    assert half_in(turned(np.round(swing / 15) * 15)) < half_in(turned(swing)) / 1.5
    assert half_in(turned(np.linspace(0, 30, 41))) == pytest.approx(0.5)
    assert np.isnan(half_in(turned(np.zeros(40)))), "nothing moves"


class Answering(Paste):
    """The others turn about x, the further the hand is from the recording; `gain` says by what share."""

    def __init__(self, gain: Callable[[int, np.ndarray, np.ndarray], np.ndarray]) -> None:
        """gain(passes, degrees a tick of the window (B,), of the hand (B,))."""
        super().__init__(JOINTS, np.tile(quaternion.IDENTITY, (len(JOINTS), 1)))
        self.gain = gain

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[np.ndarray] | None = None,
    ) -> tuple[Poses, Poses]:
        made, latents = super().iterate(windows, coding_iterations, interaction_iterations, hold)
        if hold is None or not interaction_iterations:
            return made, latents
        targets = np.broadcast_to(hold.targets, windows.shape)[:, :, hold.mask]
        away = quaternion.angle_between(targets, windows[:, :, hold.mask]).mean(axis=2)
        paces = [
            np.degrees(quaternion.angle_between(each[:, 1:], each[:, :-1])).mean(axis=(1, 2))
            for each in (windows, targets)
        ]
        turn = quaternion.from_axis_angle(
            [1.0, 0.0, 0.0], self.gain(interaction_iterations, *paces)[:, None] * away
        )
        made[:, :, ~hold.mask] = quaternion.multiply(turn[:, :, None], made[:, :, ~hold.mask])
        return made.astype(np.float32), latents


def passed(found: list[Claim]) -> str:
    return "".join(one.letter for one in found if one.holds_on_the_whole)


@pytest.mark.parametrize(
    ("kind", "options", "expected"),
    [
        (Copy, {}, "ab"),
        (Paste, {}, "ab"),
        (Mean, {}, "d"),  # whatever forgets a hand in five passes holds (d)
        (Mean, {"pull": 0.1}, "ad"),  # a tenth of the way is a small error after one pass
        (Untrained, {"seed": 0}, "d"),
        (Untrained, {"seed": 1}, "d"),
    ],
)
def test_a_network_that_knows_nothing_fails_what_it_must(
    takes: list[Take], mean: np.ndarray, kind: type[NullNetwork], options: dict[str, float], expected: str
) -> None:
    found = claims(trials(takes, kind(JOINTS, mean, **options), names=tuple(WHY)))
    assert passed(found) == expected
    by_letter = {one.letter: one for one in found}
    assert all(margin < 0.9 for margin in by_letter["c"].margins.values()), "not even narrowly"


def claim(letter: str, holds: bool, rightly: tuple[str, ...] = ()) -> Claim:
    bound = Bound("degrees", "degrees", 3.0)
    return Claim(
        letter, "Words.", "degrees", (bound,), {"x": {"degrees": 1.0 if holds else 9.0}}, ("x",), rightly
    )


@pytest.mark.parametrize(
    ("passes", "rightly", "message"),
    [
        (("copy", "paste"), ("copy", "paste"), "copy and paste pass, rightly: nothing is to change"),
        (("copy", "mean"), ("copy",), "says nothing of what was learned: mean passes too"),
        (("mean", "untrained"), (), "says nothing of what was learned: mean and untrained pass too"),
        ((), (), "no null network passes"),
    ],
)
def test_a_verdict_says_which_null_network_passes_too(
    passes: tuple[str, ...], rightly: tuple[str, ...], message: str
) -> None:
    nulls = {kind.name: [claim("x", False), claim("d", kind.name in passes)] for kind in KINDS}
    assert worth(claim("d", True, rightly), nulls) == message


def test_a_dancer_that_pauses_on_poses_and_jumps_is_intermittent(takes: list[Take]) -> None:
    by_letter = {one.letter: one for one in claims(trials(takes, Pausing()))}
    assert by_letter["c"].holds_on_the_whole
    figures = by_letter["c"].figures["coordinated"]
    assert figures["pauses_10"] > 0.3 and figures["sharper"] > 1.5


def test_an_answer_as_the_paper_has_it_passes(takes: list[Take]) -> None:
    """What the null networks fail can be passed: (e), (f), (g)."""
    grows = Answering(lambda passes, _, hand: np.full(len(hand), 0.012 * passes))
    assert "e" in passed(claims(trials(takes, grows, names=("coordinated",))))
    paced = Answering(lambda _, __, hand: 0.5 / (1 + 0.2 * hand))
    assert "f" in passed(claims(trials(takes, paced, names=("torso",))))
    startled = Answering(lambda _, window, __: 0.2 * window)
    assert "g" in passed(claims(trials(takes, startled, names=tuple(WHY))))


def test_chance_passes_a_rank_once_in_twenty() -> None:
    speeds = np.array([18.0, 66.0, 72.0, 76.0, 116.0])
    answers = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    found = [chance(speeds, np.array(order)) for order in permutations(answers)]
    assert sum(one <= 0.05 for one in found) == 5 and chance(speeds, answers) == pytest.approx(1 / 120)
    assert chance(speeds, np.full(5, 0.2)) == 1.0, "equal answers go with nothing"
    assert chance(speeds[:3], answers[:3]) > 0.05, "three excerpts are too few"
    random = np.random.default_rng(5)
    many = [chance(np.arange(12.0), random.normal(size=12)) for _ in range(60)]
    assert sum(one <= 0.05 for one in many) <= 6 and chance(np.arange(12.0), np.arange(12.0)) < 0.001


@pytest.mark.parametrize(
    ("bound", "value", "margin"),
    [
        (Bound("x", "x", 3.0), 1.5, 2.0),
        (Bound("x", "x", 3.0), 6.0, 0.5),
        (Bound("x", "x", 3.0), 0.0, 99.0),
        (Bound("x", "x", 3.0, at_least=True), 6.0, 2.0),
        (Bound("x", "x", 3.0, at_least=True), -1.0, 0.0),
        (Bound("x", "x", 3.0, at_least=True), float("nan"), 0.0),
        (Bound("x", "x", 3.0), float("nan"), 0.0),
    ],
)
def test_a_margin_is_how_many_times_over_a_bound_is_kept(bound: Bound, value: float, margin: float) -> None:
    assert bound.margin({"x": value}) == pytest.approx(margin)
