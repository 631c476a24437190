"""Motion out of the latents: paths that close, windows that blend, a network on its own motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from appliance.dancer.material import latent_paths
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.coded_windows import decoded, encoded
from appliance.studio.evaluation.coders import Poses
from appliance.studio.granular.granular import cycle, fed_back, once
from tests.studio.conftest import bunraku
from tests.studio.tiny import moving, untrained

JOINTS, LATENT, WINDOWS = len(moving()), 16, 120


@pytest.fixture(scope="module")
def autoencoder() -> Autoencoder:
    return untrained()


def steps(poses: Poses) -> np.ndarray:
    """(T,): degrees from each pose (M, 4) to the next, the last leading into the first."""
    return np.degrees(quaternion.angle_between(np.roll(poses, -1, axis=0), poses)).mean(axis=1)


@pytest.mark.parametrize("spread", [0.5, 2.0])
def test_a_walk_has_the_spread_of_the_prior_and_closes(spread: float) -> None:
    path = latent_paths.walked(WINDOWS, LATENT, spread, waves=4, seed=1)
    assert path.shape == (WINDOWS, LATENT)
    np.testing.assert_allclose(np.sqrt((path**2).mean(axis=0)), spread, rtol=1e-4)
    jumps = np.linalg.norm(np.roll(path, -1, axis=0) - path, axis=1)
    assert jumps[-1] < 2 * np.median(jumps), "the end leads into the beginning"


def test_a_faster_walk_changes_more() -> None:
    slow, fast = (latent_paths.walked(WINDOWS, LATENT, 1.0, waves, 1) for waves in (2, 12))
    change = [np.linalg.norm(np.diff(path, axis=0), axis=1).mean() for path in (slow, fast)]
    assert change[1] > 3 * change[0]


def test_seeds_tell_walks_and_samples_apart_and_repeat_them() -> None:
    for make in (
        lambda seed: latent_paths.walked(40, LATENT, 1.0, 3, seed),
        lambda seed: latent_paths.sampled(40, LATENT, 1.0, seed),
    ):
        np.testing.assert_array_equal(make(7), make(7))
        assert np.abs(make(7) - make(8)).max() > 0.5


def test_between_two_excerpts_the_ends_are_theirs_and_the_middle_is_as_long() -> None:
    rng = np.random.default_rng(0)
    one, other = (rng.standard_normal((30, LATENT)).astype(np.float32) for _ in range(2))
    np.testing.assert_allclose(latent_paths.between(one, other, 0.0, 0.0, 1), one, atol=1e-5)
    np.testing.assert_allclose(latent_paths.between(one, other, 1.0, 0.0, 1), other, atol=1e-5)
    half = latent_paths.between(one, other, 0.5, 0.0, 1)
    lengths = np.linalg.norm(half, axis=1)
    expected = (np.linalg.norm(one, axis=1) + np.linalg.norm(other, axis=1)) / 2
    np.testing.assert_allclose(lengths, expected, rtol=1e-4)
    moved = latent_paths.between(one, other, 0.5, 1.0, 1) - half
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), atol=1e-5)


def test_a_cycle_has_no_seam(autoencoder: Autoencoder) -> None:
    windows = decoded(autoencoder, latent_paths.walked(WINDOWS, LATENT, 2.0, 4, 1))
    for hop in (1, 4):
        danced = cycle(windows[::hop], hop)
        assert danced.shape == (len(windows[::hop]) * hop, JOINTS, 4)
        np.testing.assert_allclose(np.linalg.norm(danced, axis=-1), 1.0, atol=1e-4)
        made = steps(danced)
        assert made[-1] <= made.max() and made[-1] < 4 * np.median(made) + 1e-3
    np.testing.assert_allclose(
        np.abs((once(windows, 1)[20:] * cycle(windows, 1)[20:]).sum(-1)), 1.0, atol=1e-4
    )


def test_latents_of_windows_decode_where_they_faced(autoencoder: Autoencoder) -> None:
    turn = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 1.2)
    windows = np.tile(quaternion.IDENTITY, (3, 8, JOINTS, 1)).astype(np.float32)
    windows[:, :, 0] = turn
    latents, facing = encoded(autoencoder, windows)
    np.testing.assert_allclose(np.abs(facing @ turn), 1.0, atol=1e-5)
    ahead, turned = decoded(autoencoder, latents), decoded(autoencoder, latents, facing)
    expected = quaternion.multiply(turn, ahead[:, :, 0])
    np.testing.assert_allclose(np.abs((turned[:, :, 0] * expected).sum(-1)), 1.0, atol=1e-5)


def test_fed_back_with_all_of_the_phrase_is_the_phrase_coded(autoencoder: Autoencoder) -> None:
    windows = decoded(autoencoder, latent_paths.walked(60, LATENT, 2.0, 3, 1))
    with torch.no_grad():
        coded = autoencoder.iterate(torch.from_numpy(windows), 1)[0].numpy()
    whole = fed_back(autoencoder, windows, share=1.0)
    np.testing.assert_allclose(np.abs((whole * once(coded, 1)).sum(-1)), 1.0, atol=1e-4)
    left_alone = fed_back(autoencoder, windows, share=0.0)
    assert np.isfinite(left_alone).all()
    evenness = [np.ptp(steps(danced)[30:-1]) for danced in (left_alone, whole)]
    assert evenness[0] < 0.1 * evenness[1], "it no longer follows the phrase"


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--samples", "--hop", "4"),
        ("--from", "sway_1", "--to", "sway_2@1", "--mix", "0.3", "--offset", "0.5"),
        ("--feedback", "0.2"),
    ],
)
def test_the_command_makes_a_phrase_that_a_show_can_play(
    trained: tuple[Path, object], tmp_path: Path, options: tuple[str, ...]
) -> None:
    out = tmp_path / "phrase.bvh"
    done = bunraku("granular", trained[0] / "checkpoint.pt", "--out", out, "--seconds", 2, *options)
    assert done.exit_code == 0, done.output
    phrase = read_bvh(out)
    assert len(phrase) >= 90 and phrase.fps == pytest.approx(50.0)
    assert np.isfinite(phrase.poses).all() and np.isfinite(phrase.roots).all()
    assert out.with_suffix(".png").stat().st_size > 10_000
    reported = json.loads(out.with_suffix(".json").read_text())
    assert reported["naturalness"]["seconds"] == pytest.approx(len(phrase) / 50, abs=0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--from", "nobody"), "There is no take 'nobody'. There are"),
        (("--from", "sway_1@soon"), "'soon' is no second of sway_1: write sway_1@12.5"),
        (("--from", "sway_1@99"), "99 s is not in it"),
        (("--hop", "9"), "--hop 9 leaves gaps between windows of 8 poses"),
    ],
)
def test_what_cannot_be_is_said(
    trained: tuple[Path, object], tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    done = bunraku("granular", trained[0] / "checkpoint.pt", "--out", tmp_path / "p.bvh", *options)
    assert done.exit_code == 2
    assert message in done.output
    assert not (tmp_path / "p.bvh").exists()


def test_a_network_of_single_poses_is_not_fed_with_its_own_motion(
    pose_checkpoint: Path, tmp_path: Path
) -> None:
    done = bunraku("granular", pose_checkpoint, "--out", tmp_path / "phrase.bvh", "--feedback", "0.2")
    assert done.exit_code == 2 and "knows single poses" in done.output


def test_long_windows_are_trained_danced_and_no_show(recordings: Path, tmp_path: Path) -> None:
    folder = tmp_path / "long"
    sizes = ("--network", "mlp", "--window", 32, "--width", 32, "--latent", 8, "--steps", 20)
    done = bunraku("train", "--recordings", recordings, "--out", folder, "--threads", 1, *sizes)
    assert done.exit_code == 0, done.output
    assert "bunraku granular" in done.output and not (folder / "puppet.onnx").exists()
    checkpoint, out = folder / "checkpoint.pt", tmp_path / "phrase.bvh"
    done = bunraku("granular", checkpoint, "--out", out, "--seconds", 3, "--hop", 16)
    assert done.exit_code == 0, done.output
    assert len(read_bvh(out)) in range(140, 161)
    for refused in (("export", checkpoint, "--out", tmp_path / "show"), ("evaluate", checkpoint, out)):
        done = bunraku(*refused)
        assert done.exit_code == 2
        assert "windows of 32 poses, and the box dances windows of 8" in " ".join(done.output.split())
