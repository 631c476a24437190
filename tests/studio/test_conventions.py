"""Twelve systems' files through every door; two (--long: all) are also trained on, evaluated and played."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.exchange.retargeting import lowest_m
from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.pose.body_facts import fronts, height_m
from appliance.pose.bvh import write_bvh
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import read_upright
from appliance.pose.skeleton import Skeleton
from appliance.recorder.reading import read_journal
from tests.cli.test_cli import write_box
from tests.command import Command
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of
from tests.studio.conftest import bunraku as studio
from tests.studio.test_commands import said

SMALL = ("--steps", 2, "--width", 16, "--latent", 4, "--threads", 1, "--device", "cpu")
FLOOR_M = 0.02


def write(path: Path, convention: str, seconds: float, seed: int = 0) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bvh(path, as_the_system_writes(dance_of(convention, seconds, seed=seed), convention))
    return path


def assert_a_dancer(
    skeleton: Skeleton, poses: Array, roots: Array, translations: Array | None = None
) -> None:
    """1.2 to 2.2 m tall, soles on the floor, the front to the audience."""
    positions, world = skeleton.forward_kinematics(poses, roots)
    assert 1.2 < height_m(skeleton, positions) < 2.2
    assert np.abs(lowest_m(skeleton, positions, world)).max() < FLOOR_M
    front = fronts(skeleton, positions)
    assert front is not None and front.mean(axis=0)[1] > 0.8


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_file_of_every_system_is_a_dancer(tmp_path: Path, convention: str, bunraku: Command) -> None:
    file, system = write(tmp_path / "take.bvh", convention, 2.0), CONVENTIONS[convention]
    looked = studio("inspect", file, "--json")
    assert looked.exit_code == 0, said(looked)
    (facts,) = json.loads(looked.stdout)
    assert 1.2 < facts["height_m"] < 2.2 and facts["doubts"] == [] and abs(facts["facing_degrees"]) < 45
    taken = {joint["taken_for"]: joint["name"] for joint in facts["joints"]}
    assert taken["left upper arm"] == system.name("left upper arm") and facts["root"] == system.name("hips")
    dance, _ = read_upright(file)
    assert_a_dancer(dance.skeleton, dance.poses[:1], dance.roots[:1])
    bones = humanoid_bones(dance.skeleton.names)
    assert dance.skeleton.names[bones["LeftUpperArm"]] == system.name("left upper arm")
    assert {"Hips", "Spine", "Head", "RightFoot"} <= set(bones)
    bunraku("filmstrip", file, "--out", tmp_path / "strip.png", "--seconds", "0.1")
    assert (tmp_path / "strip.png").stat().st_size > 10_000


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_system_s_recordings_become_a_show_that_dances(
    tmp_path: Path, convention: str, bunraku: Command, long_run: bool
) -> None:
    if convention not in ("LAFAN", "Unreal") and not long_run:
        pytest.skip("every system's: --long")
    folder, show = tmp_path / "recordings", tmp_path / "show"
    for take in range(2):
        write(folder / f"take_{take}.bvh", convention, 6.0, seed=take)
    trained = studio("train", "--recordings", folder, "--out", show, *SMALL)
    assert trained.exit_code == 0, said(trained)
    arm = CONVENTIONS[convention].name("left upper arm")
    assert yaml.safe_load((show / "show.yaml").read_text())["hands"][0]["joint"] == arm
    measured = studio("evaluate", show, folder / "take_1.bvh", "--json")
    assert measured.exit_code == 0, said(measured)
    box = write_box(tmp_path)
    journal = tmp_path / "journal"
    bunraku("play", "--alone", "--show", show, "--box", box, "--seconds", "0.5", "--journal", journal)
    danced = read_journal(journal)
    assert danced.header["hands"][0]["joint"] == arm
    poses, roots = danced.ticks["pose"].astype(float), danced.ticks["root"].astype(float)
    assert_a_dancer(danced.skeleton, poses, roots)
    assert (danced.skeleton.stance is not None) == (convention == "LAFAN")
    for look in ("plaster", "lines", "ink", "cloud", "veil") if long_run else ():
        picture = tmp_path / f"{look}.png"
        bunraku("filmstrip", show / "phrase.bvh", "--seconds", "1", "--look", look, "--out", picture)
        assert picture.stat().st_size > 10_000
