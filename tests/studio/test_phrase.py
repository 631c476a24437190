"""The phrase: closed without a seam, on its stage, on its feet; what it is measured by; the whole command."""

from __future__ import annotations

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from appliance.dancer.grounding import survey
from appliance.dancer.loop import is_closed, turns_about_y, yaws
from appliance.dancer.material.carrying import smoothed
from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.steps import Steps
from appliance.dancer.motion_source import Playback
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.recording import Recording
from appliance.studio import dance_files
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.data.dataset import Take, load_dataset
from appliance.studio.export.chosen_phrase import choose_phrase
from appliance.studio.improviser import naturalness, phrase
from appliance.studio.improviser.footing import plant_feet
from appliance.studio.improviser.improvisation import ImproviseOptions, run
from appliance.studio.improviser.improviser import Improviser
from appliance.studio.improviser.moves import MovesShape
from appliance.studio.improviser.naturalness import Yardstick, distances, measure
from appliance.studio.improviser.pace import pace
from appliance.studio.improviser.phrase import STAGE_M, PhraseOptions, closed_loop, on_stage
from appliance.studio.improviser.stretches import best_stretches
from appliance.studio.standing import measure_standing
from appliance.studio.studio_error import StudioError
from tests.studio.conftest import bunraku
from tests.studio.tiny import moving, skeleton, swaying, write_recordings


def take_of(recording: Recording, name: str) -> Take:
    return Take(name, name, recording, np.ones(len(recording), dtype=bool), 50.0, 50.0)


def strolling(seconds: float, speed: float = 0.3, turn: float = 0.2) -> Recording:
    """The swaying dancer walks off in a curve."""
    sway = swaying(seconds)
    time = np.arange(len(sway)) / sway.fps
    poses = sway.poses.copy()
    poses[:, 0] = quaternion.multiply(turns_about_y(turn * time), poses[:, 0])
    roots = sway.roots + np.stack([speed * time, 0 * time, 0.2 * np.sin(time)], axis=1)
    return Recording(sway.skeleton, quaternion.continuous(poses), roots, sway.fps)


def steps_between(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Turns in degrees and moves in centimetres of each frame to the next, the last one to the first."""
    poses, roots = recording.poses, recording.roots
    turns = np.degrees(quaternion.angle_between(poses, np.roll(poses, -1, axis=0))).max(axis=1)
    return turns, 100 * np.linalg.norm(np.roll(roots, -1, axis=0) - roots, axis=1)


def test_a_stretch_becomes_a_cycle_whose_seam_is_a_step_like_any_other() -> None:
    loop = closed_loop(strolling(12.0), 37, 437)
    turns, moves = steps_between(loop)
    assert len(loop) == 400
    assert is_closed(loop.poses.astype(np.float32), loop.roots.astype(np.float32))
    assert turns[-1] <= np.percentile(turns, 99) and moves[-1] <= np.percentile(moves, 99)


def test_outside_its_seam_a_cycle_is_the_dance_itself_but_for_the_miss() -> None:
    dance = strolling(12.0)
    loop = closed_loop(dance, 37, 437)
    own, true = loop.poses[60:, 1:], dance.poses[97:437, 1:]
    assert np.degrees(quaternion.angle_between(own, true)).max() < 1e-3


def test_what_is_missing_of_a_whole_turn_is_spread_over_the_cycle() -> None:
    loop = closed_loop(strolling(12.0, turn=0.2), 37, 437)
    heading = np.unwrap(yaws(quaternion.heading(loop.poses[:, 0])))
    sway = np.unwrap(yaws(quaternion.heading(closed_loop(swaying(12.0), 37, 437).poses[:, 0])))
    assert abs(heading[-1] - heading[0]) < np.radians(6)
    assert np.abs(np.diff(heading)).max() < np.abs(np.diff(sway)).max() + np.radians(0.3)


def test_the_box_plays_a_cycle_for_ever_on_the_same_spot() -> None:
    loop = closed_loop(strolling(12.0), 37, 437)
    playback = Playback(loop)
    places = []
    for _ in range(3 * len(loop)):
        places.append(playback.roots()[0].copy())
        playback.advance()
    first, last = np.array(places[: len(loop)]), np.array(places[-len(loop) :])
    np.testing.assert_allclose(first, last, atol=1e-4)


def test_a_path_too_long_for_the_stage_is_narrowed_and_its_steps_are_kept() -> None:
    time = np.arange(2000) / 50
    sway = swaying(40.0)
    far = np.stack([4 * np.sin(2 * np.pi * time / 40), 0 * time, 3 * np.cos(2 * np.pi * time / 40)], axis=1)
    bounce = 0.05 * np.sin(2 * np.pi * 2 * time)[:, None]
    phrase = on_stage(replace(sway, roots=far + bounce * [1, 0, 1] + [7, 0.8, 0]))
    assert (np.ptp(phrase.roots[:, [0, 2]], axis=0) <= STAGE_M + 1e-9).all()
    np.testing.assert_allclose(phrase.roots[:, 0].max() + phrase.roots[:, 0].min(), 0, atol=1e-9)
    quick = np.abs(np.fft.rfft(phrase.roots[:, 0]))[80] * 2 / 2000
    assert quick == pytest.approx(0.05, rel=0.05)


def test_a_path_that_fits_is_only_moved_to_the_middle() -> None:
    sway = swaying(9.0)
    phrase = on_stage(replace(sway, roots=sway.roots + np.array([5.0, 0, 5.0])))
    np.testing.assert_allclose(np.diff(phrase.roots, axis=0), np.diff(sway.roots, axis=0), atol=1e-12)


def test_the_stretch_whose_end_meets_its_start_is_found() -> None:
    dance = swaying(24.0)  # repeats itself every 3 seconds
    yardstick = Yardstick.of([take_of(dance, "sway")], moving())
    found = best_stretches([dance], yardstick, 9.0, STAGE_M, 0.8, 3)
    length_s = (found[0].last - found[0].first) / 50
    assert 8.1 <= length_s <= 9.9
    assert abs(length_s / 3 - round(length_s / 3)) < 0.03
    assert found[0].cost <= found[1].cost <= found[2].cost


def test_feet_that_slid_stand_and_nothing_is_below_the_floor() -> None:
    """A dancer who sways 20 cm from side to side on feet that ought to stand."""
    time = np.arange(200) / 50
    sway = swaying(4.0)
    legs = [
        j for j, name in enumerate(sway.skeleton.names) if "T" in name[1:] or name[1:] in ("Shin", "Foot")
    ]
    poses = sway.poses.copy()
    poses[:, [0, *legs]] = quaternion.IDENTITY
    poses[:, legs[0]] = quaternion.from_axis_angle([1, 0, 0], 0.02 * np.sin(2 * np.pi * time / 4))
    poses[:, legs[1]] = quaternion.from_axis_angle([1, 0, 0], 0.02 + 0.02 * np.sin(2 * np.pi * time / 4))
    roots = np.stack([0.04 * np.sin(2 * np.pi * time / 4), np.full(200, 0.79), 0 * time], axis=1)
    phrase = Recording(sway.skeleton, quaternion.continuous(poses), roots, 50.0)
    before, after = (
        measure_standing(p.skeleton, p.poses, p.roots, survey(p)) for p in (phrase, plant_feet(phrase, 60))
    )
    assert before.slide_cm_s > 3
    assert after.slide_cm_s < 0.4 * before.slide_cm_s
    assert after.worst_penetration_cm < 1.0


def test_a_phrase_on_its_feet_is_still_a_cycle() -> None:
    phrase = plant_feet(closed_loop(swaying(10.0), 0, 300), 20)
    assert is_closed(phrase.poses.astype(np.float32), phrase.roots.astype(np.float32))
    np.testing.assert_allclose(np.linalg.norm(phrase.poses, axis=-1), 1.0, atol=1e-6)


def test_smoothing_a_cycle_keeps_its_mean_and_knows_no_ends() -> None:
    values = np.random.default_rng(0).normal(size=(40, 2))
    np.testing.assert_allclose(smoothed(values, 9).mean(axis=0), values.mean(axis=0))
    np.testing.assert_allclose(
        smoothed(np.roll(values, 7, axis=0), 9), np.roll(smoothed(values, 9), 7, axis=0)
    )
    np.testing.assert_allclose(smoothed(np.full((20, 1), 3.0), 15), 3.0)


def test_a_recording_measured_by_itself_is_as_natural_as_can_be() -> None:
    takes = [take_of(swaying(9.0, seed), f"sway {seed}") for seed in range(3)]
    natural = measure(takes[0].recording, Yardstick.of(takes, moving()))
    assert natural.liveliness == pytest.approx(natural.pace.speed / natural.recorded_pace.speed)
    assert natural.likeness.strangeness < 1e-3 and natural.likeness.nearest_second_cm < 1.0
    assert natural.likeness.coverage >= 1 / 3
    assert natural.seam is not None and natural.seam.closed  # three seconds of sway, three times
    json.dumps(natural.as_json())


def test_trembling_freezing_and_haste_are_seen() -> None:
    still_after = swaying(9.0)
    frozen = replace(still_after, poses=still_after.poses.copy())
    frozen.poses[200:] = frozen.poses[200]
    usual = pace(still_after, moving(), 1.0).speed
    assert pace(still_after, moving(), usual).longest_still_s < 1
    assert 4 < pace(frozen, moving(), usual).longest_still_s <= 5.5
    rng = np.random.default_rng(1)
    shaken = quaternion.from_axis_angle(rng.normal(size=(*still_after.poses.shape[:2], 3)), 0.02)
    trembling = replace(still_after, poses=quaternion.multiply(still_after.poses, shaken))
    assert pace(trembling, moving(), usual).trembling > 10 * pace(still_after, moving(), usual).trembling
    assert pace(trembling, moving(), usual).jerk_p99 > 10 * pace(still_after, moving(), usual).jerk_p99
    twice = replace(still_after, poses=still_after.poses[::2], roots=still_after.roots[::2])
    assert pace(twice, moving(), usual).speed == pytest.approx(2 * usual, rel=0.02)


def test_figures_are_as_far_apart_as_their_joints_are_on_average() -> None:
    a = np.zeros((1, 6))
    b = np.array([[3.0, 4.0, 0.0, 0.0, 0.0, 5.0]])
    assert distances(a, b)[0, 0] == pytest.approx(5.0)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A pose autoencoder of a few steps, and the recordings that it saw."""
    folder = tmp_path_factory.mktemp("improvise")
    recordings = write_recordings(folder / "dancer", seconds=7.0)
    torch.set_num_threads(1)
    training = Training(load_dataset(recordings), Settings(steps=30, latent=8, width=32, batch=32))
    training.run(lambda line: None, lambda: None)
    training.save_checkpoint(folder / "checkpoint.pt")
    return folder / "checkpoint.pt", recordings


def test_a_phrase_is_made_and_the_same_again_from_what_was_kept(
    checkpoint: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "phrase.bvh"
    small = PhraseOptions(seconds=4.0, seed=4, dances=2, minutes=0.2, finalists=1, settling=5)
    options = ImproviseOptions(checkpoint[0], out, checkpoint[1], steps=2, threads=1, phrase=small)
    assert run(options)
    phrase = read_bvh(out)
    assert phrase.fps == pytest.approx(50.0) and 3.5 <= phrase.seconds <= 4.5
    assert is_closed(phrase.poses.astype(np.float32), phrase.roots.astype(np.float32))
    beside = {file.name for file in tmp_path.iterdir()}
    assert beside == {f"phrase.{end}" for end in ("bvh", "json", "png", "improviser.pt", "improviser.png")}
    reported = json.loads((tmp_path / "phrase.json").read_text())
    assert reported["improviser"]["steps"] == 2
    assert reported["naturalness"]["seconds"] == pytest.approx(phrase.seconds)
    bytes_before = out.read_bytes()
    capsys.readouterr()
    monkeypatch.setattr("appliance.studio.dance_files.draw_filmstrip", lambda *_, **__: None)  # slow
    assert run(options)
    assert "continues at 100 %" in capsys.readouterr().err
    assert out.read_bytes() == bytes_before


def test_a_prompt_is_continued_where_it_ends_without_a_seam(
    checkpoint: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("appliance.studio.dance_files.draw_filmstrip", lambda *_, **__: None)
    write_bvh(tmp_path / "prompt.bvh", strolling(8.0))
    written = read_bvh(tmp_path / "prompt.bvh")
    options = ["--recordings", checkpoint[1], "--steps", 2, "--threads", 1, "--seconds", 4, "--from", 6]
    out = tmp_path / "on.bvh"
    result = bunraku("improvise", checkpoint[0], "--prompt", tmp_path / "prompt.bvh", "--out", out, *options)
    assert result.exit_code == 0, result.output
    dance, reported = read_bvh(out), json.loads(out.with_suffix(".json").read_text())
    join = round(reported["joined_s"] * 50)
    assert 5.0 < reported["joined_s"] <= 6.0 and len(dance) == pytest.approx(join + 200, abs=2)
    kept = join - 20
    np.testing.assert_allclose(
        np.degrees(quaternion.angle_between(dance.poses[:kept], written.poses[:kept])).max(), 0, atol=0.2
    )
    ground = dance.roots[:, [0, 2]]
    steps = np.linalg.norm(np.diff(ground, axis=0), axis=1)
    assert steps[join - 25 : join + 25].max() < 0.03, "nobody is carried off where the prompt ends"
    assert reported["seam_degrees"] < 20 and "prompt ends at" in " ".join(result.stderr.split())


def test_a_prompt_that_is_too_short_is_named(checkpoint: tuple[Path, Path], tmp_path: Path) -> None:
    write_bvh(tmp_path / "prompt.bvh", swaying(3.0))
    options = ["--recordings", checkpoint[1], "--steps", 2, "--threads", 1, "--from", 1]
    result = bunraku(
        "improvise",
        checkpoint[0],
        "--prompt",
        tmp_path / "prompt.bvh",
        "--out",
        tmp_path / "on.bvh",
        *options,
    )
    assert result.exit_code == 2 and "continues from 1." in " ".join(result.stderr.split()), result.output


def test_the_command_hands_its_options_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    received: list[ImproviseOptions] = []
    monkeypatch.setattr(
        "appliance.studio.improviser.improvisation.run", lambda options: bool(received.append(options))
    )
    options = ["--seconds", "75", "--seed", "9", "--minutes", "3", "--temperature", "0.9", "--dances", "5"]
    result = bunraku("improvise", "c.pt", "--out", tmp_path / "p.bvh", *options, "--dance-minutes", 2)
    assert result.exit_code == 130  # not done: stopped before its end
    assert received == [
        ImproviseOptions(
            Path("c.pt"), tmp_path / "p.bvh", minutes=3.0, phrase=PhraseOptions(75.0, 9, 0.9, 5, 2.0)
        )
    ]


def test_recordings_of_another_dancer_are_refused(checkpoint: tuple[Path, Path], tmp_path: Path) -> None:
    other = write_recordings(tmp_path / "other", seconds=3.0)
    for file in other.glob("*.bvh"):
        file.write_text(file.read_text().replace("lHand", "lPaw"))
    result = bunraku("improvise", checkpoint[0], "--recordings", other, "--out", tmp_path / "p.bvh")
    assert result.exit_code == 2
    assert not (tmp_path / "p.bvh").exists()


@pytest.mark.usefixtures("quickly_written")
def test_an_improviser_is_trained_by_train_and_continues_a_prompt_like_its_own(
    checkpoint: tuple[Path, Path], tmp_path: Path
) -> None:
    arguments = ["--model", "improviser", "--steps", 2, "--threads", 1, "--out", tmp_path / "moves"]
    result = bunraku("train", "--puppet", checkpoint[0], "--recordings", checkpoint[1], *arguments)
    assert result.exit_code == 0, result.output
    assert ImproviserNetwork(tmp_path / "moves/improviser.onnx", skeleton().names).latent
    write_bvh(tmp_path / "prompt.bvh", strolling(6.0))
    asked = ["--prompt", tmp_path / "prompt.bvh", "--seconds", 2, "--recordings", checkpoint[1]]
    model = tmp_path / "moves" / "checkpoint.pt"
    result = bunraku("improvise", "--model", model, *asked, "--out", tmp_path / "on.bvh")
    assert result.exit_code == 0, result.output
    assert read_bvh(tmp_path / "on.bvh").seconds == pytest.approx(8.0, abs=0.2)
    again = bunraku("train", "--resume", "--steps", 3, "--out", tmp_path / "moves")
    assert again.exit_code == 0, again.output


def drifting(seconds: float) -> Recording:
    """A sway whose limbs turn on and on, and never come back to where they began."""
    dance = swaying(seconds, seed=5)
    on_and_on = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.linspace(0.0, 3.0, len(dance)))
    for name in ("lShldr", "rShldr", "lThigh", "rThigh"):
        joint = dance.skeleton.index(name)
        dance.poses[:, joint] = quaternion.multiply(on_and_on, dance.poses[:, joint])
    return dance


def test_the_stretch_that_loops_is_the_phrase(tmp_path: Path) -> None:
    write_bvh(tmp_path / "a_wanders.bvh", drifting(24.0))
    write_bvh(tmp_path / "b_loops.bvh", swaying(18.0, seed=1))
    write_bvh(tmp_path / "c_wanders.bvh", drifting(20.0))
    chosen = choose_phrase(load_dataset(tmp_path))
    assert chosen is not None and chosen.recording == "b_loops"
    phrase, seam = chosen.phrase, chosen.natural.seam
    assert phrase.seconds >= 12.0 and abs(chosen.to_s - chosen.from_s - phrase.seconds) < 0.05
    assert is_closed(phrase.poses.astype(np.float32), phrase.roots.astype(np.float32))
    assert seam is not None and seam.degrees < 1.5 * seam.around_degrees
    assert max(chosen.natural.stage_m) < 4.0
    assert chosen.as_json()["seconds_of_it"] == [round(chosen.from_s, 2), round(chosen.to_s, 2)]


def test_short_recordings_have_no_phrase_that_loops(tmp_path: Path) -> None:
    assert choose_phrase(load_dataset(write_recordings(tmp_path / "dancer", count=2, seconds=5.0))) is None


def test_a_short_first_take_and_a_long_second_one_have_a_phrase_and_are_compared_in_bounded_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(naturalness, "MOST_COMPARED", 60)
    folder = write_recordings(tmp_path / "dancer", count=1, seconds=1.5)
    for number in (1, 2):
        write_bvh(folder / f"sway_{number}.bvh", swaying(40.0, seed=number))
    dataset = load_dataset(folder)
    assert dataset.training[0].recording.seconds < 2.0
    assert choose_phrase(dataset) is not None
    assert len(Yardstick.of(dataset.takes, dataset.moving).shapes) <= 62
    with pytest.raises(StudioError, match="No recording has 2 s without a capture error"):
        Yardstick.of(dataset.training[:1], dataset.moving)


def test_what_lies_between_two_capture_errors_may_be_a_few_frames(tmp_path: Path) -> None:
    dataset = load_dataset(write_recordings(tmp_path / "dancer", count=2, seconds=20.0))
    for take in dataset.takes:
        take.sound[[20, 24, 26]] = False
    chosen = choose_phrase(dataset)
    assert chosen is not None and chosen.from_s > 0.5


def test_a_full_disk_leaves_the_phrase_that_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def half(path: Path, *_: object, **__: object) -> None:
        path.write_text("HIERARCHY")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (tmp_path / "phrase.bvh").write_text("the one before")
    monkeypatch.setattr(dance_files, "write_bvh", half)
    with pytest.raises(OSError, match="space"):
        dance_files.write_recording(tmp_path / "phrase.bvh", swaying(1.0))
    assert [file.read_text() for file in tmp_path.iterdir()] == ["the one before"]


def test_recordings_too_short_to_go_on_from_are_refused() -> None:
    short = Steps(np.zeros((20, 8), np.float32), np.zeros((20, 4), np.float32))
    with pytest.raises(StudioError, match=r"No recording has 2\.8 s .* to go on from"):
        phrase.improvise(Improviser(MovesShape(8, 6, 4, 4, 24), 12, 1, 2), [short], PhraseOptions())
