"""Variations: time warping tells timing from form, noise moves a phrase, bunraku vary writes what it made."""

from __future__ import annotations

import json
import random
from pathlib import Path

import numpy as np
import pytest

from appliance.dancer.material.cyclic import hann_mean
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.studio.evaluation.coders import load_checkpoint
from appliance.studio.variations import variations
from appliance.studio.variations.timing import difference, retimed, warping_path
from tests.studio.conftest import bunraku
from tests.studio.tiny import moving, swaying

WINDOW = 32


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> Path:
    """A sequence model after 80 steps; what the command said lies beside it."""
    out = tmp_path_factory.mktemp("sequence")
    options = ["--window", WINDOW, "--steps", 80, "--width", 64, "--latent", 12, "--threads", 1]
    result = bunraku("train", "--model", "sequence", "--recordings", recordings, "--out", out, *options)
    assert result.exit_code == 0, result.output
    (out / "said.txt").write_text(result.output)
    return out


def phrase_of(seed: int = 0) -> np.ndarray:
    return swaying(4.0, seed).poses[:, list(moving())].astype(np.float32)


def test_a_phrase_is_no_distance_from_itself() -> None:
    found = difference(phrase_of(), phrase_of())
    assert found.degrees < 1e-3 and found.warped < 1e-3 and found.shift_s == 0


def test_another_timing_of_the_same_form_is_timing_and_another_form_is_not() -> None:
    phrase = phrase_of()
    ticks = np.arange(len(phrase))
    late = np.clip(ticks - 12 + 6 * np.sin(ticks / 20), 0, len(phrase) - 1).astype(int)
    timing = difference(phrase, phrase[late])
    turn = quaternion.from_axis_angle([1.0, 0.0, 0.0], 0.5)
    form = difference(
        phrase, quaternion.multiply(phrase, np.broadcast_to(turn, phrase.shape)).astype(np.float32)
    )
    assert timing.degrees > 1 and timing.timing > 0.7 and timing.shift_s > 0.1
    assert form.degrees > 10 and form.timing < 0.2


def test_a_warping_path_leads_from_corner_to_corner_without_a_step_back_and_none_is_cheaper() -> None:
    count, reach = 40, 10
    whole = np.random.default_rng(3).random((count, count))
    costs = np.full((count, 2 * reach + 1), np.inf)
    for row in range(count):
        for column in range(max(0, row - reach), min(count, row + reach + 1)):
            costs[row, column - row + reach] = whole[row, column]
    path = np.array(warping_path(costs))
    assert path[0].tolist() == [0, 0] and path[-1].tolist() == [count - 1, count - 1]
    steps = np.diff(path, axis=0)
    assert steps.min() >= 0 and steps.max() == 1 and (steps.sum(axis=1) >= 1).all()
    assert np.abs(path[:, 0] - path[:, 1]).max() <= reach
    cheapest = np.full((count + 1, count + 1), np.inf)
    cheapest[0, 0] = 0
    for row, column in np.ndindex(count, count):
        if abs(row - column) <= reach:
            before = min(cheapest[row, column], cheapest[row, column + 1], cheapest[row + 1, column])
            cheapest[row + 1, column + 1] = whole[row, column] + before
    assert whole[tuple(path.T)].sum() == pytest.approx(cheapest[-1, -1])


def test_the_more_noise_the_further_from_the_phrase(model: Path) -> None:
    coder, _ = load_checkpoint(model / "checkpoint.pt")
    phrase = variations.encode_phrase(coder.autoencoder, phrase_of())
    own = variations.varied(coder.autoencoder, phrase, 0.0, 1)
    assert len(own) == phrase.ticks and phrase.ticks > 4 * WINDOW

    def off(sigma: float) -> float:
        made = [variations.varied(coder.autoencoder, phrase, sigma, seed) for seed in range(6)]
        return float(np.mean([difference(own, one).degrees for one in made]))

    distances = [off(sigma) for sigma in (0.25, 0.5, 1.0, 2.0, 4.0)]
    assert (np.diff(distances) > 0).all(), distances
    again = [variations.varied(coder.autoencoder, phrase, 1.0, seed) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(again[0], again[1])
    assert difference(again[0], again[2]).degrees > 0.5 * difference(own, again[0]).degrees > 0


def test_without_noise_the_phrase_comes_back_and_not_the_networks_blur_of_it(model: Path) -> None:
    coder, _ = load_checkpoint(model / "checkpoint.pt")
    phrase = variations.encode_phrase(coder.autoencoder, phrase_of())
    own = variations.varied(coder.autoencoder, phrase, 0.0, 1)
    assert difference(phrase.poses, own).degrees < 0.05
    assert difference(phrase.poses, phrase.known).degrees > 1  # the null product: decoded as it is


def test_other_timing_is_the_same_way_at_other_times() -> None:
    phrase = swaying(8.0)
    late = retimed(phrase, 0.15, 3)
    found = difference(phrase.poses, late.poses)
    assert found.degrees > 1 and found.timing > 0.5  # warping takes it away: the form is the same
    assert 0.02 < found.shift_s < 0.4
    for end in (0, -1):
        np.testing.assert_allclose(late.poses[end], phrase.poses[end], atol=1e-9)
        np.testing.assert_allclose(late.roots[end], phrase.roots[end], atol=1e-9)
    fastest = retimed(phrase, 9.0, 3)  # more than a body can: it never goes back in time
    assert np.abs(np.diff(fastest.roots[:, 0])).max() < 1.35 * np.abs(np.diff(phrase.roots[:, 0])).max()
    assert difference(phrase.poses, retimed(phrase, 0.15, 4).poses).degrees != found.degrees


def test_at_0_the_file_is_the_phrase_and_at_a_quarter_its_timing_is_another(
    model: Path, recordings: Path, tmp_path: Path
) -> None:
    def shares(*options: object) -> dict[str, dict[str, float]]:
        arguments = ["--model", model / "checkpoint.pt", "--count", 1, "--out", tmp_path, *options]
        result = bunraku("vary", recordings / "sway_0.bvh", *arguments)
        assert result.exit_code == 0, result.output
        found: dict[str, dict[str, float]] = json.loads((tmp_path / "variations.json").read_text())["figures"]
        assert found["0_sigma"]["degrees"] < 0.05
        return found

    shares("--sigma", 0)
    phrase, same = (read_bvh(tmp_path / f"{name}.bvh") for name in ("phrase", "variation_1"))
    np.testing.assert_allclose(same.roots, phrase.roots[: len(same)], atol=1e-6)
    assert np.degrees(quaternion.angle_between(same.poses, phrase.poses[: len(same)])).max() < 0.1
    assert shares("--sigma", 0.25)["variation_1"]["timing"] > 0.3
    kept = shares("--sigma", 0.25, "--same-timing")["variation_1"]
    assert kept["timing"] < 0.2 and kept["jerk"] < 1.2


def test_a_mixture_goes_from_one_phrase_to_the_other(model: Path) -> None:
    coder, _ = load_checkpoint(model / "checkpoint.pt")
    one, other = (variations.encode_phrase(coder.autoencoder, phrase_of(seed)) for seed in (0, 1))
    ends = [each.known for each in (one, other)]
    mixed = [variations.mixed(coder.autoencoder, one, other, share, 1) for share in (0.0, 0.5, 1.0)]
    assert difference(mixed[0], ends[0]).degrees < 0.1 and difference(mixed[2], ends[1]).degrees < 0.1
    apart = difference(*ends).degrees
    assert all(difference(mixed[1], end).degrees < apart for end in ends)


def test_training_ends_with_what_noise_of_each_strength_does(model: Path) -> None:
    report = json.loads((model / "report.json").read_text())["variations"]
    rows = report["rows"]
    assert list(rows) == ["0.0", "0.5", "1.0", "2.0", "3.0", "4.0"]
    changed = [row["changed"] for row in rows.values()]
    assert changed[0] == 0 and (np.diff(changed) > 0).all() and 0 <= rows["1.0"]["timing"] <= 1
    assert report["recorded_nearest"] > 0 and report["divergence"] > 0
    said = (model / "said.txt").read_text()
    assert "by the strength of the noise" in said and "bunraku vary" in said
    assert "reading the recordings ..." in said and "varying takes kept apart ..." in said
    assert (model / "variations.png").stat().st_size > 10_000


def test_vary_writes_each_variation_its_figures_and_a_strip(
    model: Path, recordings: Path, tmp_path: Path
) -> None:
    options = ["--model", model / "checkpoint.pt", "--out", tmp_path, "--count", 2, "--seconds", 2.5]
    result = bunraku("vary", recordings / "sway_0.bvh", *options, "--sigma", 10, "--region", "arms")
    assert result.exit_code == 0, result.output
    phrase, first, second = (
        read_bvh(tmp_path / f"{name}.bvh") for name in ("phrase", "variation_1", "variation_2")
    )
    count = len(first)
    arm, belly = (phrase.skeleton.index(name) for name in ("lShldr", "abdomen"))
    assert np.degrees(quaternion.angle_between(first.poses[:, arm], phrase.poses[:count, arm])).max() > 0.2
    assert np.degrees(quaternion.angle_between(first.poses[:, arm], second.poses[:, arm])).max() > 0.05
    np.testing.assert_allclose(
        quaternion.angle_between(first.poses[:, belly], phrase.poses[:count, belly]), 0, atol=2e-3
    )
    figures = json.loads((tmp_path / "variations.json").read_text())["figures"]
    assert list(figures) == ["phrase", "0_sigma", "variation_1", "variation_2"]
    assert figures["variation_1"]["degrees"] > 0 and figures["phrase"]["nearest"] < 0.5
    assert (tmp_path / "variations.png").exists() and "arms only" in result.output
    assert "2 of 2: planting the feet of variation_2 ..." in result.output


def test_samples_of_the_prior_need_no_phrase_and_two_phrases_mix(
    model: Path, pose_checkpoint: Path, recordings: Path, tmp_path: Path
) -> None:
    checkpoint = model / "checkpoint.pt"
    result = bunraku("vary", "--free", "--model", checkpoint, "--out", tmp_path / "free", "--count", 2)
    assert result.exit_code == 0, result.output
    assert len(read_bvh(tmp_path / "free" / "sample_2.bvh")) == WINDOW
    other = recordings / "sway_1.bvh"
    out = ["--model", checkpoint, "--out", tmp_path / "mix", "--on-map", pose_checkpoint]
    result = bunraku("vary", recordings / "sway_0.bvh", "--mix", other, "--share", 0.3, *out)
    assert result.exit_code == 0 and (tmp_path / "mix" / "mixed.bvh").exists(), result.output
    assert (tmp_path / "mix" / "map.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{rec}/sway_0.bvh", "--model", "{puppet}"], "is no sequence model"),
        (["{rec}/sway_0.bvh", "--model", "{pose}"], "is no sequence model"),
        (["{rec}/sway_0.bvh", "--model", "{rec}/sway_0.bvh"], "is not a checkpoint"),
        (["{rec}/none.bvh", "--model", "{model}/checkpoint.pt"], "does not exist"),
        (["{rec}/sway_0.bvh", "--model", "{model}/checkpoint.pt", "--start", "9"], "is not in it"),
        (
            ["{rec}/sway_0.bvh", "--model", "{model}/checkpoint.pt", "--start", "3.8"],
            "the model sees 32 at once",
        ),
    ],
)
def test_what_cannot_be_varied_is_named(
    arguments: list[str],
    message: str,
    model: Path,
    recordings: Path,
    puppet_checkpoint: Path,
    pose_checkpoint: Path,
    tmp_path: Path,
) -> None:
    places = {"rec": recordings, "model": model, "puppet": puppet_checkpoint, "pose": pose_checkpoint}
    result = bunraku("vary", *(each.format(**places) for each in arguments), "--out", tmp_path)
    assert result.exit_code == 2 and message in " ".join(result.stderr.split()), result.output


def test_a_phrase_or_free_is_asked_for(model: Path, tmp_path: Path) -> None:
    result = bunraku("vary", "--model", model / "checkpoint.pt", "--out", tmp_path)
    assert result.exit_code == 2 and "PHRASE" in result.stderr


def test_windows_of_a_spin_join_whatever_their_signs(rng: random.Random) -> None:
    """A joint that turns five times a second, decoded with either sign: blended it turns as evenly."""
    length, hop, count = 32, 8, 20
    ticks = (count - 1) * hop + length
    spin = quaternion.from_axis_angle([0, 1, 0], 2 * np.pi * 5 / 50 * np.arange(ticks))[:, None]
    starts = np.arange(count) * hop
    windows = np.stack([rng.choice((-1, 1)) * spin[start : start + length] for start in starts])
    danced = hann_mean(variations.aligned_windows(windows, starts, ticks), starts, ticks)
    steps = np.degrees(quaternion.angle_between(danced[1:], danced[:-1]))
    np.testing.assert_allclose(steps, 36.0, atol=0.1)
