"""Real motion capture: our reading of every recording against pybvh's, joint by joint."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybvh
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import leading_tpose_frames, read_bvh, write_bvh

CM_PER_M = 100
SPINE = {"hip", "abdomen", "chest", "neck", "head"}
LIMBS = {side + name for side in "lr" for name in ("Shldr", "ForeArm", "Hand", "Thigh", "Shin", "Foot")}


@pytest.fixture(scope="module")
def recordings(recordings_dir: Path, long_run: bool) -> list[Path]:
    """All recordings, or the three shortest of each folder: of one source and one kind of dance."""
    of_folder: dict[Path, list[Path]] = {}
    for path in sorted(recordings_dir.glob("**/*.bvh"), key=lambda path: path.stat().st_size):
        of_folder.setdefault(path.parent, []).append(path)
    return [path for paths in of_folder.values() for path in (paths if long_run else paths[:3])]


def test_every_joint_is_where_pybvh_finds_it(recordings: list[Path]) -> None:
    assert len(recordings) >= 9
    for path in recordings:
        ours = read_bvh(path)
        positions, _ = ours.skeleton.forward_kinematics(ours.poses, ours.roots, ours.translations)
        theirs = pybvh.read_bvh_file(str(path))
        order = [theirs.node_index[name] for name in ours.skeleton.names]
        expected = theirs.node_positions()[:, order]
        np.testing.assert_allclose(positions * CM_PER_M, expected, atol=1e-4, err_msg=path.name)
        ends = [order[joint] for joint, _ in ours.skeleton.ends]
        assert len(ends) == len(theirs.node_positions()[0]) - len(order), path.name


def test_what_we_write_is_read_by_pybvh_as_we_meant_it(recordings: list[Path], tmp_path: Path) -> None:
    ours = read_bvh(recordings[0], true_fps=60, drop_tpose=True).resampled(50)
    write_bvh(tmp_path / "written.bvh", ours)
    positions, _ = ours.skeleton.forward_kinematics(ours.poses, ours.roots)
    theirs = pybvh.read_bvh_file(str(tmp_path / "written.bvh"))
    order = [theirs.node_index[name] for name in ours.skeleton.names]
    np.testing.assert_allclose(positions * CM_PER_M, theirs.node_positions()[:, order], atol=1e-4)
    assert theirs.frame_time == pytest.approx(0.02)


def test_the_tpose_is_found_in_every_recording(recordings: list[Path]) -> None:
    for path in recordings:
        recording = read_bvh(path)
        dropped = leading_tpose_frames(recording)
        assert 1 <= dropped <= 8, path.name
        rest = recording.without_first(dropped).poses[:8]
        steps = np.degrees(quaternion.angle_between(rest[1:], rest[:-1]))
        assert steps.max() < 15, path.name


def test_resampling_a_dance_keeps_its_length_and_its_moving_joints(recordings_dir: Path) -> None:
    path = next(recordings_dir.glob("**/salsa_18.bvh"))
    whole = read_bvh(path, true_fps=60, drop_tpose=True)
    at_50 = whole.resampled(50)
    assert at_50.seconds == pytest.approx(whole.seconds, abs=0.04)
    turned = np.degrees(quaternion.angle_between(at_50.poses, at_50.poses[:1])).max(axis=0)
    moving = {name for name, degrees in zip(at_50.skeleton.names, turned, strict=True) if degrees > 0.5}
    assert moving == SPINE | LIMBS
