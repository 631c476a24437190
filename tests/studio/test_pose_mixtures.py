"""The published improviser: poses that come back, a likelihood that improves, dances that --seed decides."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from appliance.dancer.loop import turns_about_y
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.studio.autoencoder.models import settings_for
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.improviser.pose_mixtures import components_of
from appliance.studio.improviser.pose_mixtures_training import (
    PoseMixturesSettings,
    PoseMixturesTraining,
    load_pose_improviser,
)
from appliance.studio.improviser.pose_steps import pose_motion, pose_steps
from tests.studio.bodies import body, moved
from tests.studio.conftest import bunraku
from tests.studio.test_improviser import walking
from tests.studio.tiny import moving, skeleton, swaying

TINY = PoseMixturesSettings(
    steps=120, window=10, width=24, depth=2, mixtures=2, batch=32, learning_rate=1e-2, smoothing=0.9
)
SIZES = ["--window", 10, "--width", 16, "--depth", 1, "--mixtures", 2, "--steps", 4, "--threads", 1]


@pytest.fixture(scope="module")
def dancer(recordings: Path) -> Dataset:
    return load_dataset(recordings)


@pytest.fixture(scope="module")
def improviser(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> Path:
    """The folder of an improviser as published, of a few steps."""
    out = tmp_path_factory.mktemp("improviser")
    arguments = ["--network", "lstm-mixtures", "--recordings", recordings, "--out", out, *SIZES]
    result = bunraku("train", "--model", "improviser", *arguments)
    assert result.exit_code == 0, result.output
    assert "bunraku improvise --model" in " ".join(result.stderr.split())
    return out


def test_poses_become_steps_and_poses_again_where_they_were() -> None:
    recording, rest = walking(), np.tile(quaternion.IDENTITY, (len(moving()), 1))
    poses, roots = pose_motion(pose_steps(recording, moving(), rest), recording.poses[0], moving())
    first, facing = 1, quaternion.inverse(quaternion.heading(recording.poses[0, 0]))
    true = recording.poses[first : first + len(poses)]
    off = quaternion.angle_between(poses[:, 0], quaternion.multiply(facing, true[:, 0]))
    assert np.degrees(quaternion.angle_between(poses[:, 1:], true[:, 1:])).max() < 0.01
    assert np.degrees(off).max() < 0.1
    went = quaternion.rotate(facing, recording.roots[first : first + len(roots)])
    off = (roots - roots[0]) - (went - went[0])
    assert np.abs(off[:, [0, 2]]).max() < 1e-3


def test_steps_do_not_know_where_the_dancer_stands_and_faces() -> None:
    recording, rest = walking(), np.tile(quaternion.IDENTITY, (len(moving()), 1))
    turn, poses = turns_about_y(np.array(2.0)), recording.poses.copy()
    poses[:, 0] = quaternion.multiply(turn, poses[:, 0])
    roots = quaternion.rotate(turn, recording.roots) + np.array([3.0, 0.7, -2.0])
    here, there = (
        pose_steps(one, moving(), rest) for one in (recording, replace(recording, poses=poses, roots=roots))
    )
    np.testing.assert_allclose(here.features, there.features, atol=1e-4)


def test_components_keep_the_variance_that_is_asked_for() -> None:
    numbers = torch.randn(4000, 5) * torch.tensor([10.0, 3.0, 1.0, 0.1, 0.1])
    assert [components_of(numbers, share) for share in (0.5, 0.95, 0.999, 1.0)] == [1, 2, 3, 5]


def test_the_published_values_are_the_preset() -> None:
    preset = settings_for("improviser", "lstm-mixtures")
    assert isinstance(preset, PoseMixturesSettings)
    assert (preset.depth, preset.variance, preset.learning_rate) == (3, 0.95, 1e-5)
    assert 32 <= preset.width <= 512 and 10 <= preset.window <= 128
    assert 1 <= preset.ahead <= 4 and 3 <= preset.mixtures <= 25


@pytest.mark.parametrize("ahead", [1, 4])
def test_the_likelihood_improves_and_comes_back_from_the_checkpoint(
    dancer: Dataset, tmp_path: Path, ahead: int
) -> None:
    training = PoseMixturesTraining(dancer, replace(TINY, ahead=ahead))
    training.held_rows, training.held_starts = training.rows, training.starts
    before = training.held_out()["nats"]
    training.run(lambda line: None, lambda: training.save_checkpoint(tmp_path / "checkpoint.pt"))
    after = training.history[-1].held_out
    assert after["nats"] < min(before, after["gaussian"]) - 0.3
    assert after["stays"] < after["gaussian"]
    improviser, _ = load_pose_improviser(tmp_path / "checkpoint.pt")
    assert improviser.joints == dancer.moving_names
    looks = training.rows[:10][None]
    torch.testing.assert_close(improviser.network(looks).means, training.averaged(looks).means)


def test_a_body_of_58_joints_dances_on(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        write_bvh(tmp_path / f"{name}.bvh", moved(body(fingers=9), seconds=4.0, seed=seed))
    many = load_dataset(tmp_path)
    training = PoseMixturesTraining(many, replace(TINY, steps=2))
    training.run(lambda line: None, lambda: training.save_checkpoint(tmp_path / "checkpoint.pt"))
    improviser, _ = load_pose_improviser(tmp_path / "checkpoint.pt")
    start = pose_steps(many.training[0].recording, many.moving, improviser.rest).features[:10]
    (dance,) = improviser.dances(torch.tensor(start)[None], many, 1.0, 1.0, 1)
    assert len(many.moving) == 58 and dance.poses.shape == (50, 58, 4)
    np.testing.assert_allclose(np.linalg.norm(dance.poses, axis=-1), 1.0, atol=1e-6)


def test_a_resumed_training_is_the_same_training(dancer: Dataset, tmp_path: Path) -> None:
    def trained(steps: int, go_on: bool = False) -> PoseMixturesTraining:
        training = PoseMixturesTraining(dancer, TINY)
        if go_on:
            training.restore(torch.load(tmp_path / "half.pt", weights_only=True))
        for _ in range(steps):
            training.train_step()
        return training

    trained(3).save_checkpoint(tmp_path / "half.pt")
    resumed = trained(3, go_on=True).averaged.state_dict()
    for name, value in trained(6).averaged.state_dict().items():
        torch.testing.assert_close(resumed[name], value, atol=0, rtol=0, msg=name)


def test_training_ends_with_what_it_does_on_its_own_output(improviser: Path) -> None:
    assert (improviser / "pictures/losses.png").stat().st_size > 10_000
    reported = json.loads((improviser / "report.json").read_text())
    assert set(reported["temperatures"]) == {"1.0", "0.5", "0.0"}
    for row in (*reported["temperatures"].values(), reported["recordings"]):
        assert 0 <= row["trembling"] <= 1 and row["longest_still_s"] >= 0
    assert set(reported["held_out"]) == {"nats", "gaussian", "stays"}
    assert (improviser / "dances.png").stat().st_size > 1000


@pytest.mark.usefixtures("quickly_written")
def test_a_prompt_is_continued_and_the_seed_decides_how(improviser: Path, tmp_path: Path) -> None:
    write_bvh(tmp_path / "prompt.bvh", swaying(3.0))
    dances = []
    for name, seed in (("one", 1), ("again", 1), ("other", 2)):
        out = tmp_path / f"{name}.bvh"
        asked = ["--prompt", tmp_path / "prompt.bvh", "--from", 2, "--seconds", 2, "--seed", seed]
        result = bunraku("improvise", "--model", improviser / "checkpoint.pt", "--out", out, *asked)
        assert result.exit_code == 0, result.output
        dances.append(read_bvh(out))
    assert len(dances[0]) == 200
    assert json.loads((tmp_path / "one.json").read_text())["joined_s"] == pytest.approx(2.0)
    np.testing.assert_array_equal(dances[0].poses, dances[1].poses)
    assert np.abs(dances[0].poses[120:] - dances[2].poses[120:]).max() > 0.01
    arm = skeleton().index("lForeArm")
    off = quaternion.angle_between(
        dances[0].poses[:80, arm], read_bvh(tmp_path / "prompt.bvh").poses[:80, arm]
    )
    assert np.degrees(off).max() < 0.01  # what was the prompt's stays the prompt's


@pytest.mark.usefixtures("quickly_written")
def test_without_a_prompt_it_goes_on_from_a_recorded_moment(improviser: Path, tmp_path: Path) -> None:
    out = tmp_path / "free.bvh"
    result = bunraku("improvise", "--model", improviser / "checkpoint.pt", "--seconds", 2, "--out", out)
    assert result.exit_code == 0, result.output
    assert len(read_bvh(out)) == 100
    assert "joined_s" not in json.loads(out.with_suffix(".json").read_text())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["improvise", "--out", "{out}"], "Give the dancer's checkpoint.pt, or an improviser"),
        (["improvise", "--model", "{puppet}", "--out", "{out}"], "is no improviser. Train one with"),
        (["improvise", "{mixtures}", "--out", "{out}"], "is an improviser, for bunraku improvise --model"),
        (
            ["train", "--model", "improviser", "--recordings", "{rec}", "--out", "{out}"],
            "Give its checkpoint",
        ),
        (
            ["train", "--model", "pose", "--ahead", "2", "--recordings", "{rec}", "--out", "{out}"],
            "--ahead is not for the network mlp",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_its_cure(
    improviser: Path,
    puppet_checkpoint: Path,
    recordings: Path,
    tmp_path: Path,
    arguments: list[str],
    message: str,
) -> None:
    places = {
        "mixtures": improviser / "checkpoint.pt",
        "puppet": puppet_checkpoint,
        "rec": recordings,
        "out": tmp_path / "out",
    }
    result = bunraku(*(one.format(**places) for one in arguments))
    assert result.exit_code == 2 and message in " ".join(result.stderr.split()), result.output
