"""Figures of the held dance: dancers that copy, paste, go to the mean, are random or repeat fail one each."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.studio.data.dataset import Take
from appliance.studio.evaluation import critic as critics
from appliance.studio.evaluation import puppetry
from appliance.studio.evaluation.comparison import FIGURES, Comparison, Row
from appliance.studio.evaluation.comparison_report import comparison_sentences, comparison_table
from appliance.studio.evaluation.measurement import WINDOW, Measurement, Pair
from appliance.studio.evaluation.nearest import reference_of
from appliance.studio.evaluation.recorded import Recorded
from tests.studio.dancers import ARM, danced, motions
from tests.studio.puppets import NAMES, Pasting
from tests.studio.tiny import moving

PLACES, SECONDS, PAIRS = list(moving()), 10.0, 2
HELD = NAMES.index(ARM)


def take(name: str, seed: int, seconds: float = 20.0) -> Take:
    dance = danced(motions(seconds, seed))
    return Take(name, name, dance, np.ones(len(dance), dtype=bool), 50.0, 50.0)


@pytest.fixture(scope="module")
def training() -> list[Take]:
    return [take(f"learned_{seed}", 100 + seed) for seed in range(6)]


@pytest.fixture(scope="module")
def comparison(training: list[Take]) -> Comparison:
    pairs = [
        Pair(danced(motions(SECONDS, seed)), danced(motions(SECONDS, seed + 50)), f"phrase_{seed}", "hand")
        for seed in range(PAIRS)
    ]
    reference = reference_of(training, NAMES)
    measurements = [Measurement(Pasting(), pair, reference) for pair in pairs]
    return Comparison(measurements, Recorded(training, NAMES))


@pytest.fixture(scope="module")
def rows(comparison: Comparison, training: list[Take]) -> dict[str, Row]:
    """The figures of dancers that dance in a known way."""
    found: dict[str, list[np.ndarray]] = {}
    rng = np.random.default_rng(3)
    for seed, one in enumerate(comparison.measurements):
        phrase, hand = one.rehearsal.phrase, one.pair.hand.poses[WINDOW - 1 :, PLACES][:, HELD]
        hand = hand[: len(phrase)].astype(np.float32)
        sane = motions(SECONDS, seed)
        sane[:, 0] = motions(SECONDS, seed + 50)[:, 0]  # what belongs to the arm, as the hand has it
        alive = danced(sane).poses[WINDOW - 1 :, PLACES][: len(phrase)]
        mean = np.repeat(quaternion.normalize(phrase.mean(axis=0))[None], len(phrase), axis=0)
        noise = quaternion.normalize(rng.normal((4.0, 0, 0, 0), 1.0, phrase.shape))
        learned = training[0].recording.poses[: len(phrase), PLACES]
        known = {"copies": phrase, "pastes": phrase, "mean": mean, "random": noise, "repeats": learned}
        for name, poses in {**known, "sane": alive}.items():
            shown = poses.astype(np.float32).copy()
            if name != "copies":
                shown[:, HELD] = hand
            found.setdefault(name, []).append(one.stood(ARM, shown, hand))
    before, critics.STEPS = critics.STEPS, 60
    try:
        return {name: comparison.row(ARM, dances) for name, dances in found.items()}
    finally:
        critics.STEPS = before


def test_a_dance_that_is_alive_passes(rows: dict[str, Row]) -> None:
    sane = rows["sane"]
    assert sane["held"] < 0.1
    assert sane["critic"] < 0.75 and sane["critic_legs"] < 0.75 and sane["critic_moving"] < 0.75
    for limb in ("legs", "trunk", "arms", "held_limb"):
        assert 0.75 < sane[f"spread_{limb}"] < 1.3 and 0.75 < sane[f"energy_{limb}"] < 1.3
    assert 0.7 < sane["coupling_fidelity"] < 1.4
    assert 0.8 < sane["jerk"] / rows["copies"]["jerk"] < 1.3


def test_a_network_that_copies_is_off_the_hand_and_not_coupled(rows: dict[str, Row]) -> None:
    assert rows["copies"]["held"] > 10 and rows["copies"]["coupling_fidelity"] < 0.3
    assert rows["copies"]["off_phrase"] < 0.01 and rows["copies"]["critic"] < 0.7


def test_a_network_that_pastes_is_not_coupled(rows: dict[str, Row]) -> None:
    assert rows["pastes"]["coupling_fidelity"] < 0.3
    assert rows["pastes"]["held"] < 0.1 and rows["pastes"]["spread_legs"] == pytest.approx(1.0)


def test_a_network_that_goes_to_the_mean_has_no_spread(rows: dict[str, Row]) -> None:
    assert rows["mean"]["spread_legs"] < 0.1 and rows["mean"]["energy_legs"] < 0.1
    assert rows["mean"]["recall"] < 0.5 * rows["sane"]["recall"]


def test_a_network_that_is_random_is_told_by_the_critic(rows: dict[str, Row]) -> None:
    assert rows["random"]["critic"] > 0.95 and rows["random"]["critic_legs"] > 0.95
    assert rows["random"]["plausibility"] > 2 and rows["random"]["jerk_ratio"] > 10
    assert rows["random"]["fid_kinetic"] > 10 * rows["sane"]["fid_kinetic"]


def test_a_network_that_repeats_a_recording_has_it_by_heart(rows: dict[str, Row]) -> None:
    assert rows["repeats"]["memorisation"] < 0.3 and rows["sane"]["memorisation"] > 0.7
    assert rows["sane"]["memorisation"] > 0.8 * rows["copies"]["memorisation"]  # a take that nobody learned


def test_what_the_hands_take_did_is_nearer_to_a_coupled_dance(rows: dict[str, Row]) -> None:
    assert rows["sane"]["masked"] < 0.95 * rows["pastes"]["masked"]
    assert rows["sane"]["masked_nearest"] == rows["pastes"]["masked_nearest"]


def test_takes_too_short_for_a_clip_have_no_distance_and_do_not_end_a_training(training: list[Take]) -> None:
    recorded = Recorded([training[0], take("clapper", 901, 1.5)], NAMES)
    assert all(math.isnan(value) for value in recorded.floor(10))


def test_four_baselines_are_in_the_json_and_in_the_table(
    comparison: Comparison, training: list[Take], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(critics, "STEPS", 30)
    reported: list[str] = []
    recorded = Recorded(training, NAMES, [take("other", 900)])
    found = puppetry.measure(
        comparison.measurements[:1],
        [ARM],
        [(10, 9)],
        (10,),
        reported.append,
        turning=False,
        recorded=recorded,
    )
    baselines = found[ARM]["baselines"]
    assert list(baselines) == ["phrase", "pasted", "network", "matching"]
    assert all(set(row) == set(FIGURES) for row in baselines.values())
    assert found[ARM]["10_9"]["critic"] == baselines["network"]["critic"]
    assert found[ARM]["10_9"]["spread_legs"] == baselines["network"]["spread_legs"]
    assert found["free"]["10"]["critic_legs"] is not None
    assert found["reference"]["fid_kinetic_floor"] is not None
    assert found["reference"]["fid_kinetic_ceiling"] is not None
    assert baselines["phrase"]["held"] == 0.0 and baselines["phrase"]["jerk_ratio"] == 1.0
    assert baselines["pasted"]["coupling"] < 0.3 * baselines["phrase"]["coupling"]
    assert baselines["matching"]["held"] < 0.1
    assert baselines["matching"]["coupling"] > baselines["pasted"]["coupling"]
    assert len(reported) == puppetry.dances(1, 1, [(10, 9)], (10,), compared=True) - len(puppetry.TURNING)
    assert json.loads(json.dumps(found))[ARM]["baselines"] == baselines
    table = comparison_table(found, [ARM])
    assert table is not None and len(table.columns) == 5 and table.row_count > 20
    assert any("Without a hand" in line for line in comparison_sentences(found))


def test_the_critic_says_the_same_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(critics, "STEPS", 20)
    one, other = (danced(motions(5.0, seed)).poses[:, PLACES] for seed in (1, 2))
    areas = [critics.critic([one], [other], range(len(PLACES)), ["only"]) for _ in range(2)]
    assert areas[0] == areas[1]
    assert np.isnan(critics.critic([one[:60]], [other[:60]], [0, 1], ["only"]))  # too short to learn from


def test_a_critic_of_a_dance_that_is_the_phrase_cannot_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(critics, "STEPS", 60)
    dances = [danced(motions(8.0, seed)).poses[:, PLACES] for seed in (1, 2)]
    assert critics.critic(dances, dances, range(len(PLACES)), ["a", "b"]) == pytest.approx(0.5, abs=0.05)
    assert critics.critic(dances[:1], dances[:1], [3, 4], ["a"], moving=True) == pytest.approx(0.5, abs=0.07)
