"""What a training ends with: the sentence names what one sees, the advice follows from its cause."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest

from appliance.studio.evaluation.dancer_verdict import Learned, Seen, judge
from appliance.studio.evaluation.puppetry_report import judged, seen

GOOD = Seen(
    answer=21.0,
    error=1.9,
    energy={"legs": 0.95, "trunk": 1.1, "arms": 1.05},
    spread={"legs": 0.95, "trunk": 0.9, "arms": 1.0},
    free_energy=0.98,
    roughness=1.05,
    plausibility=1.0,
    critic=0.62,
    fits=True,
    off_hand=9.0,
)
ENOUGH = Learned(minutes=11.0, takes=20, steps=17000)


def legs(energy: float, spread: float = 1.0) -> dict[str, Any]:
    return {
        "energy": {"whole": 1.0, "legs": energy, "trunk": 1.1},
        "spread": {"whole": 1.0, "legs": spread, "trunk": 1.0},
    }


@pytest.mark.parametrize(
    ("found", "learned", "cause", "verdict", "advice"),
    [
        # barely trained, whatever else is wrong with it
        ({"error": 22.0}, {"steps": 103}, "unlearned", "22 degrees off", "Train longer.*103 steps"),
        ({"error": 22.0, "free_energy": 0.0}, {"steps": 103}, "statue", "statue", "Train longer.*103 steps"),
        ({"error": 22.0}, {"steps": 103, "minutes": 2.0, "takes": 1}, "unlearned", "22", "Train longer"),
        ({"error": 6.0, "answer": 1.0}, {"steps": 900}, "copies", "does not answer", "Train longer.*900"),
        ({"error": 22.0}, {"steps": 103, "minutes": 200.0}, "unlearned", "22", "Train longer"),
        # trained long enough, on too little
        ({"error": 12.0}, {"minutes": 2.0}, "unlearned", "12 degrees off", "More recordings.*2.0 minutes"),
        ({"answer": 1.0}, {"minutes": 2.0}, "copies", "does not answer.*1.0", "More recordings"),
        (legs(0.5), {"minutes": 2.0}, "average", "legs nearly stand", "More recordings"),
        (
            {"answer": 1.0},
            {"minutes": 11.0, "takes": 1},
            "copies",
            "does not answer",
            "more takes.*single one",
        ),
        ({}, {"minutes": 3.0}, "good", "stays alive", "More recordings give it more"),
        # enough of both: the cure is the cause's own
        ({"free_energy": 0.0}, {}, "statue", "stands still without a hand .energy 0.00", "--seed"),
        ({"error": 12.0}, {}, "unlearned", "has not learned", "--width"),
        ({"answer": 2.0}, {}, "copies", "does not answer", "Add recordings"),
        (legs(0.69), {}, "average", "answers .21 degrees., but the legs nearly stand .0.69", "liveliness"),
        (legs(0.9, 0.62), {}, "average", "the legs stay near the average pose .0.62", "liveliness"),
        (legs(0.5, 0.5), {}, "average", "nearly stand .* and the legs stay near", "liveliness"),
        ({"roughness": 2.2}, {}, "trembles", "but it trembles", "Lower liveliness"),
        (legs(1.9), {}, "trembles", "the legs are restless .1.90", "Lower liveliness"),
        ({"free_energy": 2.3}, {}, "trembles", "without a hand it is restless .2.30", "Lower liveliness"),
        ({"plausibility": 1.22}, {}, "foreign", "poses are not the dancer's", "held joint goes"),
        ({"fits": False}, {}, "foreign", "nothing that the dancer did", "held joint goes"),
        ({"off_hand": 30.0}, {}, "off", "stays 30 degrees off the hand", "interaction_iterations"),
        ({"critic": 0.97}, {}, "told", "a critic tells it .* 97 of 100", "by eye"),
        ({"answer": 6.0}, {}, "little", "answers a little: .*6.0 degrees", "coding_iterations"),
        ({}, {}, "good", "^The dancer answers, and stays alive: .*21 degrees; .*62 of 100", "^$"),
        ({}, {"steps": 900}, "good", "stays alive", "^$"),  # few large steps can be enough
        # a trunk is one, a mean of all limbs is used only without them
        ({"energy": {"trunk": 0.4}}, {}, "average", "the trunk nearly stands", "liveliness"),
        ({"energy": {"whole": 0.4}, "spread": {}}, {}, "average", "it comes nearly to rest", "liveliness"),
    ],
)
def test_the_sentence_says_what_one_sees_and_the_advice_follows_from_the_cause(
    found: dict[str, Any], learned: dict[str, Any], cause: str, verdict: str, advice: str
) -> None:
    judgement = judge(replace(GOOD, **found), replace(ENOUGH, **learned))
    assert judgement.cause == cause
    assert re.search(verdict, judgement.verdict), judgement.verdict
    assert re.search(advice, judgement.advice), judgement.advice
    assert judgement.verdict.count(".") >= 1 and len(judgement.verdict.split()) <= 32


def test_missing_figures_are_no_fault_and_no_praise() -> None:
    bare = judge(Seen(answer=12.0), Learned(11.0, 20))
    assert bare.cause == "good" and "alive" not in bare.verdict
    empty = {"legs": None, "trunk": float("nan")}
    assert judge(replace(GOOD, energy=empty, spread=empty, critic=None), ENOUGH).cause == "good"


def row(**more: float | None) -> dict[str, Any]:
    usual = {"answer": 12.0, "fit": 9.0, "fit_bare": 13.0, "energy": 1.0, "roughness": 1.0, "held": 9.0}
    return {**usual, "plausibility": 1.0, **more}


def test_the_figures_of_both_upper_arms_are_read_where_they_are() -> None:
    found = {
        "lShldr": {"10_9": row(energy_legs=0.6, critic=0.9), "2_1": row(answer=1.0), "onset_ticks": 3.0},
        "rShldr": {"10_9": row(answer=14.0, energy_legs=0.8), "onset_ticks": 3.0},
        "head": {"10_9": row(answer=1.0), "onset_ticks": 3.0},
        "free": {"1": {"energy": 0.9}, "10": {"energy": 0.8}},
    }
    read = seen(found, error=2.0)
    assert (read.answer, read.free_energy, read.critic, read.error) == (13.0, 0.8, 0.9, 2.0)
    assert read.energy["legs"] == pytest.approx(0.7) and read.energy["trunk"] is None
    assert read.fits and read.off_hand == 9.0
    assert judged(found, ENOUGH)["cause"] == "average"
    found["rShldr"]["10_9"]["fit"] = 20.0
    assert seen(found).fits is False
