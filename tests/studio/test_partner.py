"""A partner in the studio: what couples teach it, its file, and figures that null products fail."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.partner_network import GAP, LED_STEPS, SEEN, PartnerNetwork
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.commands import app
from appliance.studio.evaluation.accord import Accord
from appliance.studio.evaluation.dependence import dependence, likeness, share_led_by_second
from appliance.studio.partner import measure, training
from appliance.studio.partner.couples import Stretch, moments_of
from appliance.studio.partner.export import FILE, export_partner
from appliance.studio.partner.measure import Row, what_is_dead
from appliance.studio.partner.training import Partner, train
from tests.bundles import FIGURE, MOVING
from tests.sources import LATENT, write_improviser_network, write_show_with_sources
from tests.studio.tiny import skeleton, write_recordings

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


def test_accord_has_a_sign() -> None:
    """A couple's answer, its opposite, and a stranger: above, below and at nothing."""
    learned = Accord([(dance(wandering(n)), answering(wandering(n), 24)) for n in range(3, 9)])
    led = wandering(1)
    first, stranger = dance(led), dance(wandering(2), (0.0, 0.6, 0.8))
    assert learned(first, answering(led, 24)) > 0.4
    assert learned(first, answering(-led, 24)) < -0.2
    assert abs(learned(first, stranger)) < 0.15
    assert np.isnan(learned(first[:200], first[:200]))


FEATURES, CODE = LATENT + 4, 3


def stretches(network: ImproviserNetwork, first: int, count: int = 6) -> list[Stretch]:
    """The second dancer's moves go where the first one was shortly before; the first one's go anywhere."""
    found = []
    for take in range(count):
        chance = np.random.default_rng(first + take)
        led = np.repeat(chance.standard_normal((30, FEATURES)), 4, 0).astype(np.float32)
        own = np.roll(led, GAP, 0)[:, ::-1] + 0.1 * chance.standard_normal(led.shape).astype(np.float32)
        found += [Stretch(own, led, 1, take), Stretch(led, own, 0, take)]
    return found


def trained(folder: Path, monkeypatch: pytest.MonkeyPatch, steps: int) -> tuple[ImproviserNetwork, Partner]:
    for name, value in {"BATCH": 64, "LOOK_EVERY": 30, "WIDTH": 48, "DEEP": (32, 32)}.items():
        monkeypatch.setattr(training, name, value)
    monkeypatch.setattr(training.Answers.__init__, "__defaults__", (48, 0.1))
    write_improviser_network(folder / "improviser.onnx")
    network = ImproviserNetwork(folder / "improviser.onnx", MOVING)
    return network, train(network, stretches(network, 0), stretches(network, 100, 2), 2, 1e9, steps)


def test_a_training_too_short_to_be_looked_at_gives_what_it_learned() -> None:
    network = torch.nn.Linear(1, 1)
    begun = float(network.weight.detach())
    descent = training._Descent(20, lambda message: None).within(1e9, "one")
    learned = descent.learn(network, lambda one: (one.weight - 9).square().sum(), lambda one: (0.0, ""))
    assert float(learned.weight.detach()) > begun


def test_its_file_gives_what_was_trained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    network, partner = trained(tmp_path, monkeypatch, 30)
    export_partner(partner, network, tmp_path / FILE)
    played = PartnerNetwork(tmp_path / FILE, MOVING)
    assert played.dancers == 2
    noise = np.random.default_rng(1).standard_normal((64, CODE)).astype(np.float32)
    own, led, who = (
        stretches(network, 200, 1)[0].own[:SEEN],
        np.ones((LED_STEPS, FEATURES), "f"),
        np.eye(2)[1],
    )
    free = played.answers(own, None, who.astype(np.float32), noise)
    with torch.no_grad():
        none = torch.zeros(1, LED_STEPS, FEATURES), torch.tensor([[0.0, 1.0]]), torch.zeros(1, 1)
        trained_so = partner.answers(torch.tensor(own[None].copy()), *none, torch.from_numpy(noise)).numpy()
    assert free == pytest.approx(trained_so, abs=0.1)
    assert not np.allclose(free, played.answers(own, led, who.astype(np.float32), noise), atol=1e-3)


def test_its_moments_follow_the_recordings_and_stray_from_them(tmp_path: Path) -> None:
    write_improviser_network(tmp_path / "improviser.onnx")
    network = ImproviserNetwork(tmp_path / "improviser.onnx", MOVING)
    alone = stretches(network, 0, 1)[0]._replace(led=None)
    moments = moments_of(network, [*stretches(network, 0, 1), alone], np.random.default_rng(1))
    assert set(moments.who.tolist()) == {0, 1} and not moments.heard.all()
    own = alone.own.astype(np.float16)
    recorded = [
        any(np.array_equal(own[at - SEEN : at], one) for at in range(SEEN, 120))
        for one in moments.own[~moments.heard]
    ]
    said = moments.recorded[~moments.heard]
    assert all(np.array(recorded)[said]) and np.mean(np.array(recorded)[~said]) < 0.2
    assert 0.2 < np.mean(said) < 0.8


def test_recordings_without_couples_are_refused_with_the_cure(tmp_path: Path) -> None:
    write_recordings(tmp_path / "takes")
    show = write_show_with_sources(tmp_path / "show")
    result = CliRunner().invoke(app, ["duet", str(tmp_path / "takes"), "--show", str(show)])
    assert result.exit_code == 2, result.output
    assert "No couple is kept apart" in result.output and "catalogue.yaml" in result.output


def test_a_joint_whose_counterpart_never_moves_counts_as_its_own() -> None:
    """A hand that only one side has a sensor for."""
    bones = skeleton()
    joints = [0, bones.index("lShldr"), bones.index("rShldr"), bones.index("lHand")]
    assert measure._counterparts(bones, joints) == [0, 2, 1, 3]


def test_couples_that_are_too_short_to_be_measured_get_no_verdict(tmp_path: Path) -> None:
    takes = write_recordings(tmp_path / "takes", count=4, seconds=10.0)
    (takes / "catalogue.yaml").write_text(
        'takes: {a: [sway_0, sway_1], b: [sway_2, sway_3]}\nheld_out: [sway_2]\nkeep: {"*": all}\n'
    )
    show = write_show_with_sources(tmp_path / "show")
    result = CliRunner().invoke(app, ["duet", str(takes), "--show", str(show)])
    assert result.exit_code == 2, result.output
    assert "Couples shorter than 11 s cannot be measured: b." in " ".join(result.output.split())


@pytest.mark.parametrize(
    ("partner", "message"),
    [
        (Row("follow 1, lead 0", 0.048, 0.3, 0.2, 0.95, 0.8, 0.9), "The partner answers"),
        (Row("follow 1, lead 0", 0.048, 0.3, 0.2, 0.95, 0.8, 0.1), "it is a statue"),
        (Row("follow 1, lead 0", 0.300, 0.5, 0.0, 0.35, 0.8, 1.0), "The partner copies"),
        (Row("follow 1, lead 0", 0.008, 0.3, 0.5, 1.0, 0.8, 1.0), "does not listen"),
    ],
)
def test_a_dead_partner_is_told(partner: Row, message: str) -> None:
    recorded = Row("recorded couples", 0.077, 0.2, 0.5, 0.97)
    copy = Row("a copy 0.5 s later (null)", 0.4, 0.5, 0.0, 0.31)
    stranger = Row("the same beside dancers of other couples (null)", 0.006, 0.0, 0.5, 1.0)
    assert message in what_is_dead([recorded, copy, partner, stranger])


def test_the_command_measures_beside_null_products_and_draws(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measure, "_FOLLOWS", (1.0,))
    monkeypatch.setattr(measure, "_LEADS", ())
    takes = tmp_path / "takes"
    takes.mkdir()
    moved = [FIGURE.index(name) for name in MOVING]
    for take, seed in (("a", 1), ("b", 2)):
        angles = wandering(seed, 700)[:, : len(moved)]
        for number, poses in enumerate((dance(angles), answering(angles, 10))):
            whole = np.tile([1.0, 0, 0, 0], (len(angles), len(FIGURE), 1))
            whole[:, moved] = poses
            roots = np.tile([0.8 * number, 1.0, 0.0], (len(angles), 1))
            write_bvh(takes / f"{take}{number}.bvh", Recording(FIGURE, whole, roots, 50.0))
    (takes / "catalogue.yaml").write_text(
        'takes: {a: [a0, a1], b: [b0, b1]}\nheld_out: [b0]\nkeep: {"*": all}\n'
    )
    show, out = write_show_with_sources(tmp_path / "show"), tmp_path / "figures" / "duet.json"
    options = ["--show", str(show), "--seconds", "10", "--out", str(out)]
    result = CliRunner().invoke(app, ["duet", str(takes), *options])
    assert result.exit_code == 0, result.output
    rows = {row["name"]: row for row in json.loads(out.read_text())}
    assert list(rows) == ["recorded couples", "a copy 0.5 s later (null)", "follow 1, lead 0"]
    assert rows["recorded couples"]["accord"] > 0.2 > abs(rows["follow 1, lead 0"]["accord"])
    likenesses = [row["likeness"] for row in rows.values()]
    assert likenesses[1] < min(likenesses[0], likenesses[2]), "a copy is told from those that answer"
    assert "The partner dances in accord" in result.output
    assert out.with_suffix(".png").read_bytes()[:4] == b"\x89PNG"
