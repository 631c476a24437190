"""A partner in the studio: what couples teach it, its file, and figures that null products fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.partner_network import GAP, LED_STEPS, PartnerNetwork
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.commands import app
from appliance.studio.evaluation.dependence import dependence, likeness, share_led_by_second
from appliance.studio.partner import training
from appliance.studio.partner.couples import Moments
from appliance.studio.partner.export import FILE, export_partner
from appliance.studio.partner.training import Answers, Scorer, found_of, nats_of, train, train_answers
from tests.bundles import MOVING
from tests.sources import write_improviser_network, write_show_with_sources
from tests.studio.tiny import write_recordings

JOINTS = ("hips", "spine", "LeftArm", "RightArm", "LeftUpLeg", "RightUpLeg")
PAIRS = (0, 1, 3, 2, 5, 4)
TICKS = 1500


def wandering(seed: int, ticks: int = TICKS) -> Array:
    """Angles (T, M) that wander about, no frequency of which comes again."""
    noise = np.random.default_rng(seed).standard_normal((ticks + 200, len(JOINTS)))
    slow = np.stack([np.convolve(one, np.hanning(60), "same") for one in noise.T], 1)[100:-100]
    angles: Array = 0.6 * slow / slow.std()
    return angles


def dance(angles: Array, axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Array:
    return quaternion.from_axis_angle(np.broadcast_to(axis, (*angles.shape, 3)), angles)


def answering(angles: Array, later: int, turned: float = 1.0) -> Array:
    """Other joints about another axis, later: an answer that is no copy, and no mirror."""
    return dance(turned * np.roll(angles[:, ::-1], later, axis=0), (0.0, 0.6, 0.8))


def test_dependence_finds_an_answer_and_says_who_comes_first() -> None:
    led = wandering(1)
    first = dance(led)
    found = dependence(first, answering(led, 24), JOINTS)
    assert found.above > 0.1 and found.lag_s == pytest.approx(0.48, abs=0.13)
    back = dependence(answering(led, 24), first, JOINTS)
    assert back.lag_s == pytest.approx(-0.48, abs=0.13)
    assert share_led_by_second(first, answering(led, 24), JOINTS) < 0.2
    assert share_led_by_second(first, answering(led, -24), JOINTS) > 0.8


def test_what_does_not_answer_and_what_copies_are_found_out() -> None:
    led = wandering(1)
    first, stranger = dance(led), dance(wandering(2), (0.0, 0.6, 0.8))
    assert abs(dependence(first, stranger, JOINTS).above) < 0.03
    assert likeness(first, stranger, PAIRS) == pytest.approx(1.0, abs=0.1)
    assert likeness(first, answering(led, 0), PAIRS) == pytest.approx(1.0, abs=0.15)
    copy, mirror = first, first[:, list(PAIRS)] * np.array([1, 1, -1, -1])
    for one in (copy, mirror):  # both depend, and are told from an answer by their likeness
        assert likeness(first, one, PAIRS) < 0.05
    assert np.isnan(dependence(first[:200], first[:200], JOINTS).above)


def couples(count: int = 300, features: int = 4) -> Moments:
    """The own move of each moment continues what the other did last; the twelve others do not."""
    chance = np.random.default_rng(3)
    led = chance.standard_normal((count, LED_STEPS, features)).astype(np.float32)
    moves = chance.standard_normal((count, 13, 11, features)).astype(np.float32)
    moves[:, 0, 3:] = led[:, -1:] + 0.3 * moves[:, 0, 3:]
    codes = led[:, -1, :3] + 0.1 * chance.standard_normal((count, 3)).astype(np.float32)
    return Moments(led, moves, codes, np.zeros(count))


def part(moments: Moments, rows: slice) -> Moments:
    return Moments(*(one[rows] for one in moments))


def test_it_learns_which_move_answers_and_only_beside_the_right_dancer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(training, "BATCH", 48)
    monkeypatch.setattr(training, "LOOK_EVERY", 50)
    moments = couples()
    learned = train(part(moments, slice(0, 240)), part(moments, slice(240, None)), 1e9, 100)
    assert learned.found > 0.5 and learned.found_shuffled < learned.found - 0.2  # chance: 1 of 13
    assert found_of(Scorer(4).eval(), part(moments, slice(240, None)))[0] < 0.3
    answers, nats, other = train_answers(
        part(moments, slice(0, 240)), part(moments, slice(240, None)), 1e9, 100
    )
    assert nats < other - 0.1
    assert nats_of(answers, part(moments, slice(240, None)))[0] == pytest.approx(nats)


def test_its_file_gives_what_was_trained(tmp_path: Path) -> None:
    write_improviser_network(tmp_path / "improviser.onnx")
    network = ImproviserNetwork(tmp_path / "improviser.onnx", MOVING)
    torch.manual_seed(1)
    scorer = Scorer(network.features, 32).eval()
    answers = Answers(network.features, network.code_size, 2, 32).eval()
    export_partner(scorer, answers, network, tmp_path / FILE)
    partner = PartnerNetwork(tmp_path / FILE, MOVING)
    led, moves = torch.randn(LED_STEPS, network.features), torch.randn(5, 11, network.features)
    with torch.no_grad():
        scores, mixture = scorer(led[None], moves[None])[0], answers(moves[:1, :3], led[None])
    assert partner.scores(led.numpy(), moves.numpy()) == pytest.approx(scores.numpy(), abs=1e-2)
    assert partner.answers(moves[0, :3].numpy(), led.numpy()) == pytest.approx(mixture.numpy(), abs=1e-2)
    assert partner.mixtures == 2 and GAP > 0


def test_recordings_without_couples_are_refused_with_the_cure(tmp_path: Path) -> None:
    write_recordings(tmp_path / "takes")
    show = write_show_with_sources(tmp_path / "show")
    result = CliRunner().invoke(app, ["duet", str(tmp_path / "takes"), "--show", str(show)])
    assert result.exit_code == 2, result.output
    assert "No couple is kept apart" in result.output and "catalogue.yaml" in result.output
