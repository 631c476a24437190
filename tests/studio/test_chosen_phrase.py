"""The phrase of a new show: a stretch that loops, chosen among all of the recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appliance.dancer.loop import is_closed
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import load_dataset
from appliance.studio.export.chosen_phrase import choose_phrase
from tests.studio.tiny import swaying, write_recordings


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


def test_what_lies_between_two_capture_errors_may_be_a_few_frames(tmp_path: Path) -> None:
    dataset = load_dataset(write_recordings(tmp_path / "dancer", count=2, seconds=20.0))
    for take in dataset.takes:
        take.sound[[20, 24, 26]] = False
    chosen = choose_phrase(dataset)
    assert chosen is not None and chosen.from_s > 0.5
