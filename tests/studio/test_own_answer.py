"""What a training says of its own dancer's answer: on the takes that there are, in sentences."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.studio.data.dataset import Dataset, Take
from appliance.studio.evaluation import own_answer, puppetry
from appliance.studio.evaluation.pairs import own_takes
from appliance.studio.evaluation.puppetry_report import sentences
from appliance.studio.studio_error import StudioError
from tests.studio.puppets import Freezing, Pasting
from tests.studio.tiny import moving, skeleton, swaying


def take(name: str, seconds: float, still: bool = False) -> Take:
    dance = swaying(seconds, seed=len(name) + ord(name[-1]))
    if still:
        dance = replace(dance, poses=np.repeat(dance.poses[:1], len(dance), axis=0))
    return Take(name, name, dance, np.ones(len(dance), dtype=bool), 50.0, 50.0)


def dataset(training: list[Take], held_out: list[Take]) -> Dataset:
    return Dataset(skeleton(), moving(), tuple(training), tuple(held_out))


@pytest.mark.parametrize(
    ("training", "held_out", "phrase", "hand", "reference", "description"),
    [
        ((9.0, 9.0), (9.0, 9.0), "apart_0", "apart_1", ["take_0", "take_1"], "never saw"),
        ((9.0, 9.0), (20.0,), "apart_0, part 1 of 2", "apart_0, part 2 of 2", ["take_0", "take_1"], "halves"),
        ((9.0, 9.0), (5.0,), "apart_0", "take_0", ["take_1"], "with hands of take_0"),
        ((9.0,), (5.0,), "apart_0", "take_0, part 1 of 2", ["take_0, part 2 of 2"], "which it learned"),
        ((30.0,), (), "take_0, part 1 of 3", "take_0, part 3 of 3", ["take_0, part 2 of 3"], "flatter"),
    ],
)
def test_phrase_hand_and_reference_never_overlap(
    training: tuple[float, ...],
    held_out: tuple[float, ...],
    phrase: str,
    hand: str,
    reference: list[str],
    description: str,
) -> None:
    takes = own_takes(
        dataset(
            [take(f"take_{k}", seconds) for k, seconds in enumerate(training)],
            [take(f"apart_{k}", seconds) for k, seconds in enumerate(held_out)],
        )
    )
    assert (takes.pairs[0].phrase_name, takes.pairs[0].hand_name) == (phrase, hand)
    assert [one.name for one in takes.reference] == reference
    assert description in takes.description


def test_one_short_take_is_too_little() -> None:
    with pytest.raises(StudioError, match="5 s long, too short"):
        own_takes(dataset([take("take_0", 5.0)], []))


def test_a_training_learns_that_its_dancer_only_copies(tmp_path: Path) -> None:
    takes = dataset([take("take_0", 9.0)], [take("apart_0", 5.0), take("apart_1", 5.0)])
    found = own_answer.own_answer(Pasting(), takes, tmp_path / "answer.png")
    assert found["cause"] == "copies" and "does not answer" in found["verdict"]
    assert "0.1 minutes of dance in a single one" in found["advice"]
    barely = own_answer.judged(found, own_answer.learned(takes, steps=103), error=22.0)
    assert barely["cause"] == "unlearned" and "103 steps" in barely["advice"]
    assert set(found["lShldr"]) == {"2_1", "10_9", "onset_ticks", "step_answer", "baselines"}
    assert (tmp_path / "answer.png").read_bytes().startswith(b"\x89PNG")


def test_a_phrase_that_stands_still_is_no_error(tmp_path: Path) -> None:
    takes = dataset(
        [take("take_0", 9.0)], [take("apart_0", 5.0, still=True), take("apart_1", 5.0, still=True)]
    )
    found = own_answer.own_answer(Freezing(), takes, tmp_path / "answer.png")
    assert found["lShldr"]["10_9"]["energy"] is None and "answer" in found["verdict"]


def test_what_cannot_be_measured_is_said_and_leaves_no_old_picture(tmp_path: Path) -> None:
    picture = tmp_path / "answer.png"
    picture.write_bytes(b"of the last training")
    found = own_answer.own_answer(Pasting(), dataset([take("take_0", 5.0)], []), picture)
    assert "too short" in found["not_measured"] and not picture.exists()
    nameless = Pasting(tuple(f"bone_{k}" for k in range(17)))
    few = dataset([take("take_0", 9.0)], [take("apart_0", 5.0), take("apart_1", 5.0)])
    bones = replace(skeleton(), names=tuple(f"bone_{k}" for k in range(20)))
    renamed = [replace(one, recording=replace(one.recording, skeleton=bones)) for one in few.held_out]
    learned = [replace(one, recording=replace(one.recording, skeleton=bones)) for one in few.training]
    found = own_answer.own_answer(nameless, dataset(learned, renamed), picture)
    assert "none of the joints" in found["not_measured"]


def test_a_slow_network_is_measured_on_less(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_answer, "MOST_TICKS", 600)
    sizes = []
    for cost in (1e-5, 4e-4, 1e-3, 1e-2):
        monkeypatch.setattr(own_answer, "_seconds_a_pass", lambda _, cost=cost: cost)
        sizes.append(own_answer.fitting_size(Pasting(), 4, 3))
    assert (sizes[0].pairs, sizes[0].joints, sizes[0].ticks) == (2, 3, 600)
    work = [size.pairs * size.joints * size.ticks for size in sizes]
    assert work == sorted(work, reverse=True) and sizes[-1].ticks == own_answer.FEWEST_TICKS


def figures(answer: float, fit: float, energy: float, plausibility: float = 0.9) -> dict[str, Any]:
    row = {"answer": answer, "fit": fit, "fit_own": 10.0, "fit_bare": 13.0, "energy": energy}
    row["plausibility"] = plausibility
    return {"lShldr": {"10_9": row, "onset_ticks": 3.0}, "head": {"10_9": row, "onset_ticks": 3.0}}


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (figures(11.0, 9.4, 0.9), "head at 10/9: this dancer answers.$"),
        (figures(3.0, 13.1, 1.1), "hardly answers"),
        (figures(11.0, 9.4, 0.46), "answers.*comes nearly to rest"),
        (figures(8.7, 12.0, 1.05, 1.22), "answers.*poses are not the dancer's"),
        (figures(11.0, 19.0, 2.06), "answers.*nothing that the dancer did.*restless"),
    ],
)
def test_a_sentence_for_each_joint_asks_for_more_than_motion(found: dict[str, Any], expected: str) -> None:
    assert len(sentences(found)) == 2 and re.search(expected, sentences(found)[1])


def test_iterations_in_play_are_preferred() -> None:
    assert puppetry.usual_iterations([(2, 1), (10, 9), (30, 29)]) == (10, 9)
    assert puppetry.usual_iterations([(2, 1), (4, 3)]) == (4, 3)
