"""What is masked is an error of the capture: jumps and swapped markers go, big gestures stay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import torch

from appliance.pictures.filmstrip import VERMILION
from appliance.pose import quaternion
from appliance.pose.recording import Recording
from appliance.studio.data.capture_errors import APART, JUMP, CaptureError, find_capture_errors, sound_frames
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.evaluation.findings import findings
from appliance.studio.evaluation.masked import draw_masked, masked_stretches
from tests.studio.bodies import body, moved
from tests.studio.conftest import bunraku
from tests.studio.test_commands import said
from tests.studio.tiny import flipped, moving, skeleton, swaying, turned, upside_down

RATES = (30.0, 60.0, 120.0)


def errors_of(*recordings: Recording) -> list[list[CaptureError]]:
    return find_capture_errors(recordings, moving())


def sound(recording: Recording, errors: list[CaptureError]) -> np.ndarray:
    return sound_frames(len(recording), recording.fps, errors)


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("joint", ["neck", "lForeArm", "rFoot"])
def test_a_jump_of_one_frame_is_found_at_any_rate(fps: float, joint: str) -> None:
    dance = swaying(8.0, fps=fps)
    spike = quaternion.from_axis_angle([0.3, 1.0, 0.0], np.radians([70.0]))
    at = round(3 * fps)
    errors = errors_of(turned(dance, joint, spike, at))[0]
    assert errors and {(error.joint, error.reason) for error in errors} == {(joint, JUMP)}
    masked = np.flatnonzero(~sound(dance, errors))
    assert at in masked and len(masked) <= 0.1 * fps + 3


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("joint", ["head", "lHand", "rFoot", "lThigh"])
def test_a_joint_that_is_upside_down_for_two_seconds_is_masked_for_two_seconds(
    fps: float, joint: str
) -> None:
    dance = swaying(20.0, fps=fps)
    errors = errors_of(flipped(dance, joint, 8, 10), swaying(20.0, seed=0, fps=fps))
    assert errors[1] == []
    assert {error.joint for error in errors[0]} == {joint}
    assert {error.reason for error in errors[0]} == {JUMP, APART}
    good = sound(dance, errors[0])
    assert not good[round(8 * fps) : round(10 * fps)].any()
    assert good[: round(7.9 * fps)].all() and good[round(10.1 * fps) :].all()


@pytest.mark.parametrize("joint", ["head", "rHand"])
def test_a_whole_take_upside_down_is_masked_beside_sound_ones(joint: str) -> None:
    dance = swaying(10.0)
    errors = errors_of(dance, flipped(dance, joint, 0, 10), replace(dance))
    assert errors[0] == errors[2] == []
    assert not sound(dance, errors[1]).any()


def gesture(fps: float, degrees: float, there_s: float, held_s: float) -> np.ndarray:
    """A turn by so much and back, as smooth as muscles make it (least jerk)."""
    share = np.linspace(0, 1, round(there_s * fps) + 1)
    there = 10 * share**3 - 15 * share**4 + 6 * share**5
    angles = np.radians(degrees) * np.concatenate([there, np.ones(round(held_s * fps)), there[::-1]])
    return quaternion.from_axis_angle([0.1, 0.2, 1.0], angles)


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize(
    ("joint", "degrees", "there_s"),
    [("lShldr", 150.0, 0.4), ("rThigh", 140.0, 0.25), ("rHand", 150.0, 0.4), ("head", 120.0, 0.4)],
    ids=["arm overhead and behind", "high kick", "hand turned over", "head thrown back"],
)
def test_a_big_gesture_is_no_error(fps: float, joint: str, degrees: float, there_s: float) -> None:
    dance = swaying(12.0, fps=fps)
    big = turned(dance, joint, gesture(fps, degrees, there_s, 1.5), round(4 * fps))
    assert errors_of(big, swaying(12.0, seed=3, fps=fps)) == [[], []]


def test_a_fight_among_waltzes_is_no_error() -> None:
    """Kicks of 1,900 degrees a second in one take of three."""
    calm = swaying(20.0, fps=120.0)
    fight = calm
    for second in range(1, 19):
        fight = turned(fight, "rShin", gesture(120.0, 110.0, 0.11, 0.0), second * 120)
    assert errors_of(calm, fight, swaying(20.0, seed=1, fps=120.0)) == [[], [], []]


def test_a_finger_that_twitches_costs_no_frame() -> None:
    dance = moved(body(fingers=5))
    spike = quaternion.from_axis_angle([0.3, 1.0, 0.0], np.radians([70.0]))
    for joint, count in (("LeftFinger2", 0), ("LeftFinger2Tip", 0), ("LeftHand", 1), ("RightFoot", 1)):
        (found,) = find_capture_errors([turned(dance, joint, spike, 300)], range(len(dance.skeleton)))
        assert len(found) == count, joint


def test_nothing_is_found_in_nothing() -> None:
    assert find_capture_errors([], moving()) == []
    still = Recording(skeleton(), np.tile(quaternion.IDENTITY, (3, 20, 1)), np.zeros((3, 3)), 50.0)
    assert errors_of(still) == [[]]


def test_the_cmu_dances_lose_their_errors_and_nothing_else(dances: Dataset) -> None:
    takes = {take.name: take for take in (*dances.training, *dances.held_out)}
    share = {name: float(np.mean(~take.sound)) for name, take in takes.items()}
    assert share["salsa_06"] == 1.0  # her head hangs upside down from the first frame to the last
    head = [error for error in takes["salsa_07"].errors if error.joint == "head" and error.reason == APART]
    assert head[0].start_s == pytest.approx(20.4, abs=0.6) and head[-1].end_s > 34.4
    assert share["salsa_13"] > 0.13 and share["salsa_14"] > 0.09  # a hand turned by 180 degrees
    assert share["salsa_24"] == pytest.approx(606 / 2144, abs=0.01)  # twelve seconds of it
    assert share["salsa_01"] > 0.08 and share["salsa_02"] > 0.03  # feet that point backwards
    clean = [f"salsa_{n}" for n in (16, 17, 18, 19, 21, 25, 28, 29, 30)] + [
        "indian_06",
        "indian_13",
        "indian_14",
    ]
    assert [name for name in clean if share[name]] == []


def test_a_fighter_s_kicks_are_no_errors(recordings_dir: Path) -> None:
    found = load_dataset(recordings_dir / "martial")
    assert [take.name for take in (*found.training, *found.held_out) if take.errors] == []


def test_errors_that_touch_are_one_stretch_the_longest_first(tmp_path: Path) -> None:
    found = load_dataset(upside_down(tmp_path / "dancer"))
    takes = [*found.training, *found.held_out]
    first, second = masked_stretches(takes)
    assert (first.take.name, second.take.name) == ("sway_0", "sway_1")
    assert abs(first.start_s - 4) < 0.05 and abs(first.end_s - 6) < 0.05
    assert first.worst.joint == "head" and len(first.errors) == 3
    assert (
        first.sentence().startswith("sway_0, 3.9")
        and "head stands as it does at no other time" in first.sentence()
    )


def test_the_findings_say_how_much_is_masked_where_and_how_to_overrule_it(tmp_path: Path) -> None:
    message = " ".join(findings(load_dataset(upside_down(tmp_path / "dancer"))))
    assert (
        "frames (8." in message
        and "in 2 recordings: sway_0 (10" in message
        and ": head), sway_1 (" in message
    )
    assert "pictures/masked.png" in message and "--keep 'sway_0'" in message


def test_the_picture_marks_the_joint(tmp_path: Path) -> None:
    found = load_dataset(upside_down(tmp_path / "dancer"))
    picture = draw_masked(tmp_path / "masked.png", found.training)
    pixels = matplotlib.image.imread(picture)[..., :3]
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    assert VERMILION.argmax() == 0
    assert ((red > 0.4) & (red > 2.5 * green) & (red > 2.5 * blue)).sum() > 1000


def test_training_draws_what_it_masked_and_remembers_what_it_must_keep(tmp_path: Path) -> None:
    folder, out = upside_down(tmp_path / "dancer"), tmp_path / "show"
    options = ["--steps", 2, "--width", 32, "--latent", 8, "--threads", 1, "--device", "cpu"]
    result = bunraku(
        "train", "--model", "pose", "--recordings", folder, "--out", out, "--keep", "sway_0", *options
    )
    assert result.exit_code == 0, said(result)
    assert "in 1 recording: sway_1" in said(result)
    assert (out / "pictures" / "masked.png").read_bytes().startswith(b"\x89PNG")
    kept = torch.load(out / "checkpoint.pt", weights_only=True)["origin"]["catalogue"]["keep"]
    assert list(kept) == ["sway_0"]
