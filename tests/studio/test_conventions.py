"""Fifteen systems' files through every door; two (--long: all) are also trained on, evaluated and played."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from appliance.lights.beams import beams_of
from appliance.lights.patch import Patch
from appliance.lights.phrase_run import passes
from appliance.outputs.osc.humanoid import humanoid_bones
from appliance.pose.body_facts import fronts, height_m
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import read_upright
from appliance.pose.skeleton import Skeleton
from appliance.projector.strip import COLUMNS, ROWS
from appliance.recorder.journal_reader import JournalRecording, read_journal
from appliance.recorder.record import holds_of
from appliance.show.show import load_show
from appliance.studio.exchange.retargeting import lowest_m
from hw_sim.osc_receiver import OscReceiver
from tests.cli.test_cli import write_box
from tests.command import Command
from tests.outputs.test_vmc import LIMBS, WAYS_DEGREES, degrees, posed_avatar
from tests.pose.conventions import CONVENTIONS, as_the_system_writes, dance_of
from tests.studio.conftest import bunraku as studio
from tests.studio.test_commands import said

LOOKS = ("plaster", "lines", "ink", "cloud", "veil", "strings")
NO_PORTS = {"control": None, "console": None, "sensors": {"udp": None}}
BEAM_M = 0.1
HELD_RED = 60  # of 255: how much redder than green and blue
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
    folder, show, system = tmp_path / "recordings", tmp_path / "show", CONVENTIONS[convention]
    for take in range(2):
        write(folder / f"take_{take}.bvh", convention, 6.0, seed=take)
    trained = studio("train", "--recordings", folder, "--out", show, *SMALL)
    assert trained.exit_code == 0, said(trained)
    arm = system.name("left upper arm")
    hand = yaml.safe_load((show / "show.yaml").read_text())["hands"][0]
    assert hand["joint"] == arm
    measured = studio("evaluate", show, folder / "take_1.bvh", "--json")
    assert measured.exit_code == 0, said(measured)
    light(show, system.name("left hand"), hold=arm)
    danced, avatar = played(tmp_path, show, bunraku)
    assert danced.header["hands"][0]["joint"] == arm
    holds = holds_of(danced.header, danced.ticks)[-1, 0]
    assert danced.skeleton.names[int(np.argmax(holds))] == arm and np.count_nonzero(holds) == 1
    poses, roots = danced.ticks["pose"][:, 0].astype(float), danced.ticks["root"][:, 0].astype(float)
    assert_a_dancer(danced.skeleton, poses, roots)
    assert (danced.skeleton.stance is not None) == (convention == "LAFAN")
    assert_an_avatar_like(avatar, danced.skeleton, poses[-1], roots[-1])
    assert_the_head_follows(show, system.name("left hand"))
    for look in LOOKS if long_run else LOOKS[:1]:
        picture = tmp_path / f"{look}.png"
        bunraku("filmstrip", tmp_path / "journal", "--look", look, "--start", "0.6", "--out", picture)
        assert_held_on_the_right(picture)


def light(show: Path, joint: str, hold: str) -> None:
    """Gives the show a moving head that follows a joint, and a hand that keeps another, without a sensor."""
    config = yaml.safe_load((show / "show.yaml").read_text())
    config["hands"] = [{"kept": True, "joint": hold}]
    follow = {"reads": "place", "joint": joint, "drives": "aim"}
    config["lights"] = {
        "fixtures": [{"name": "spot", "profile": "moving-spot", "address": 1, "place": [-2, 4, 1]}],
        "mappings": [{"name": "follow", "rules": [follow]}],
    }
    (show / "show.yaml").write_text(yaml.safe_dump(config, allow_unicode=True))


def played(folder: Path, show: Path, bunraku: Command) -> tuple[JournalRecording, dict[str, list[float]]]:
    """The journal of a second of the show, and what an avatar heard last by VMC: bone to numbers."""
    with OscReceiver("127.0.0.1") as avatar:
        receiver = {"host": "127.0.0.1", "port": avatar.port, "dialect": "vmc"}
        box = write_box(folder, yaml.safe_dump({**NO_PORTS, "outputs": {"osc": [receiver]}}))
        journal = ("--journal", folder / "journal")
        bunraku("play", "--alone", "--show", show, "--box", box, "--seconds", "1", *journal)
        messages = avatar.poll(1.0)
    heard = {str(text[0]): text[1:] for _, address, text in messages if address.endswith("/Bone/Pos")}
    return read_journal(folder / "journal"), heard


def assert_an_avatar_like(
    heard: dict[str, list[float]], skeleton: Skeleton, pose: Array, root: Array
) -> None:
    """An avatar in a T-pose that is turned as it was told has the limbs of the figure, mirrored."""
    positions, _ = skeleton.forward_kinematics(pose, root)
    avatar, joint_of = posed_avatar(heard), humanoid_bones(skeleton.names)
    for start, end in LIMBS:
        ours = (positions[joint_of[end]] - positions[joint_of[start]]) * [-1, 1, 1]
        assert degrees(ours, avatar[end][:3, 3] - avatar[start][:3, 3]) < WAYS_DEGREES, (start, end)


def assert_the_head_follows(show: Path, joint: str) -> None:
    """The light meets the joint, at a dancer's height."""
    loaded = load_show(show)
    patch, phrase = Patch(loaded.config.lights.fixtures, show), read_bvh(loaded.phrase)
    *_, last = passes(loaded.config.lights, patch, phrase, "", 0, 100, 5)
    (beam,) = beams_of(patch, last.values)
    place = last.places[phrase.skeleton.index(joint)]
    off = np.cross(place - beam.place, beam.direction)
    assert np.linalg.norm(off) < BEAM_M and 0.3 < place[1] < 2.2


def assert_held_on_the_right(picture: Path) -> None:
    """The left arm of a figure that faces the audience is on the picture's right, where the colour is."""
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    across = pixels.shape[1] // COLUMNS
    right = []
    for column in range(COLUMNS):
        panel = pixels[: pixels.shape[0] // ROWS, column * across : (column + 1) * across]
        red = panel[..., 0] - panel[..., 1:].max(axis=-1) > HELD_RED
        if red.any():
            right.append(float(np.flatnonzero(red.any(axis=0)).mean()) > 0.5 * across)
    assert len(right) == COLUMNS and np.mean(right) > 0.5, (picture.name, right)
