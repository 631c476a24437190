"""Pose and sequence models as files of a show: they compute what was trained, and carry a map."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import improvised
from appliance.dancer.material.motion_network import MotionNetwork, MotionNetworkError, map_facts
from appliance.levers.sources import PATH, VARY
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.show.bundle import default_show_path
from appliance.studio.autoencoder.architectures import build
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.coded_windows import encoded
from appliance.studio.data.regions import joints_of
from appliance.studio.evaluation.dance_figures import jerk
from appliance.studio.export import improviser_network as export
from appliance.studio.export.improviser_network import export_improviser
from appliance.studio.export.motion_network import write_motion_network
from appliance.studio.improviser.improviser import Improviser
from appliance.studio.improviser.moves import MovesShape
from appliance.studio.improviser.naturalness import standing_of
from appliance.studio.opened_model import open_show
from appliance.studio.pose_space.ground import Ground
from appliance.studio.studio_error import StudioError
from appliance.studio.variations import variations
from appliance.studio.variations.timing import difference
from tests.studio.conftest import bunraku
from tests.studio.tiny import moving, skeleton, swaying

NAMES = [skeleton().names[joint] for joint in moving()]


def untrained(network: str, window: int) -> Autoencoder:
    torch.manual_seed(1)
    made, shape = build(network, window, len(NAMES), variational=True, latent=8, width=48, depth=1)
    rest = torch.tensor(quaternion.IDENTITY).repeat(len(NAMES), 1)
    made.start_at(rest.flatten())
    return Autoencoder(made, shape, rest).eval()


@pytest.mark.parametrize("window", [1, 32])
def test_the_file_encodes_and_decodes_as_it_was_trained(tmp_path: Path, window: int) -> None:
    autoencoder = untrained("mlp", window)
    ground = map_facts(np.zeros(8), np.eye(2, 8), np.full(2, -1), np.ones(2))
    write_motion_network(autoencoder, NAMES, tmp_path / "model.onnx", ground if window == 1 else "")
    network = MotionNetwork(tmp_path / "model.onnx", skeleton().names)
    assert (network.window, network.latent, list(network.joints)) == (window, 8, NAMES)
    assert (network.ground is not None) == (window == 1)
    poses = swaying(3.0).poses[:, list(moving())].astype(np.float32)
    windows = np.stack([poses[at : at + window] for at in range(0, 100, 20)])
    latents, facing = encoded(autoencoder, windows)
    found, found_facing = network.encode(windows)
    assert np.abs(found - latents).max() < 0.02  # weights in 16 bits
    assert np.abs(quaternion.aligned(found_facing, facing) - facing).max() < 1e-5
    with torch.no_grad():
        raw = autoencoder.decode_raw(torch.from_numpy(latents)).numpy()
    assert np.abs(network.decode(latents) - raw).max() < 0.02


def test_a_network_that_the_box_does_not_take_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudioError, match="only networks of the kind mlp"):
        write_motion_network(untrained("lstm", 32), NAMES, tmp_path / "model.onnx")


@pytest.mark.parametrize("layers", [1, 2])
def test_an_improvisers_file_goes_on_as_it_was_trained(tmp_path: Path, layers: int) -> None:
    autoencoder = untrained("mlp", 8)
    improviser = Improviser(MovesShape(8, 6, 4, 4, 24), 12, layers, 2).requires_grad_(False)
    improviser.scale.learn(torch.randn(200, 12, generator=torch.Generator().manual_seed(1)))
    path = export_improviser(improviser, autoencoder, NAMES, tmp_path)
    network = ImproviserNetwork(path, skeleton().names)
    heard = torch.randn(2, 19, 12, generator=torch.Generator().manual_seed(2))
    for temperature in (0.0, 1.0):
        trained = improviser.improvise(heard, 3, temperature, 7).numpy()
        assert np.abs(improvised(network, heard.numpy(), 3, temperature, 7) - trained).max() < 0.02
    with pytest.raises(MotionNetworkError, match="kind 'motion'"):
        MotionNetwork(path, skeleton().names)


def test_an_improviser_that_was_not_exported_as_trained_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    improviser = Improviser(MovesShape(8, 6, 4, 4, 24), 12, 1, 2).requires_grad_(False)
    improviser.scale.learn(torch.randn(200, 12))
    monkeypatch.setattr(export, "FARTHEST", 0.01)  # a fault of the graph: its moves hardly move
    (tmp_path / "improviser.onnx").write_bytes(b"the one before")
    with pytest.raises(StudioError, match="differs from the trained one"):
        export_improviser(improviser, untrained("mlp", 8), NAMES, tmp_path)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"the one before"]


WITHOUT_TORCH = """
import json, sys
sys.modules["torch"] = None
from appliance.studio.commands import app
for command in json.loads(sys.argv[1]):
    try:
        app(command)
    except SystemExit as ended:
        if ended.code:
            raise
"""


def test_a_shows_networks_dance_where_torch_is_not_installed(tmp_path: Path) -> None:
    commands = (
        ["vary", "--count", "1", "--seconds", "3", "--out", tmp_path / "varied"],
        ["path", "--wobble", "0.3", "1", "--seconds", "2", "--out", tmp_path / "wobble.bvh"],
        ["granular", "--region", "legs", "--seconds", "3", "--out", tmp_path / "walk.bvh"],
        ["map", "--seconds", "4", "--out", tmp_path / "map"],
        ["improvise", "--seconds", "2", "--region", "arms", "--from", "4", "--out", tmp_path / "more.bvh"],
    )
    asked = json.dumps([[*map(str, command), "--show", "default"] for command in commands])
    done = subprocess.run([sys.executable, "-c", WITHOUT_TORCH, asked], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made = ("varied/phrase.bvh", "varied/variation_1.bvh", "wobble.bvh", "more.bvh", "walk.bvh")
    phrase, varied, wobble, more, walk = (read_bvh(tmp_path / name) for name in made)
    assert len(phrase) == 150 and len(wobble) == 100 and len(walk) == 150
    assert varied.skeleton.same_joints(phrase.skeleton)
    assert (tmp_path / "map" / "map.png").exists() and (tmp_path / "map" / "map.html").exists()
    assert differing(more, 250) == {"arms"} and differing(walk, 20) == {"legs"}
    figures = json.loads((tmp_path / "varied" / "variations.json").read_text())["figures"]
    assert figures["phrase"]["nearest"] < 0.1 < figures["variation_1"]["nearest"]


def differing(dance: Recording, first: int) -> set[str]:
    """The regions that are 5 degrees off the show's phrase or more, from a frame on."""
    phrase, found = read_bvh(default_show_path() / "phrase.bvh"), set[str]()
    part = slice(first, len(dance))
    apart = np.degrees(quaternion.angle_between(dance.poses[part], phrase.poses[part])).mean(axis=0)
    moving = open_show(PATH, default_show_path()).dataset.moving
    for region in ("arms", "legs", "torso"):
        if apart[joints_of([region], phrase.skeleton, moving)].max() > 5:
            found.add(region)
    return found


def test_feet_stand_as_on_stage_and_not_as_the_network_leaves_them(tmp_path: Path) -> None:
    """The null product: the same poses on the phrase's unchanged path slide several times as fast."""
    options = ["--show", "default", "--seconds", 6, "--count", 1, "--sigma", 1]
    result = bunraku("vary", *options, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    phrase, varied = (read_bvh(tmp_path / f"{name}.bvh") for name in ("phrase", "variation_1"))
    stood = standing_of(varied).slide_cm_s
    null = standing_of(replace(varied, roots=phrase.roots[: len(varied)])).slide_cm_s
    assert stood < 0.5 * null
    assert np.isfinite(varied.poses).all()


def test_a_variation_goes_far_from_its_phrase_and_trembles_no_more() -> None:
    """The null product is the network's own motion, which trembles without any noise."""
    opened = open_show(VARY, default_show_path())
    moving = list(opened.dataset.moving)
    own = opened.dataset.training[0].recording.excerpt(0.0, 8.0).poses[:, moving].astype(np.float32)
    phrase = variations.encode_phrase(opened.network, own)
    for seed in range(3):
        made = variations.varied(opened.network, phrase, 1.0, seed)
        assert difference(phrase.poses, made).degrees > 6
        assert jerk(made) <= 1.2 * jerk(phrase.poses)
    assert jerk(phrase.known) > 1.5 * jerk(phrase.poses)
    assert difference(phrase.poses, phrase.known).degrees > 4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["vary"], "Give --show"),
        (["vary", "--show", "default", "--model", "x.pt"], "Give --show"),
        (["vary", "--show", "martial"], "has no sequence.onnx"),
        (["path", "--show", "martial", "--wobble", "0.3", "1"], "has no pose.onnx"),
        (["path", "phrase.bvh", "--show", "default"], "--wobble AMPLITUDE FREQUENCY"),
        (["improvise", "--show", "martial"], "has no improviser.onnx"),
        (["improvise", "--show", "default", "--minutes", "3"], "--minutes"),
        (["vary", "--show", "default", "--recordings", "x"], "--recordings"),
        (["granular"], "Give a CHECKPOINT, or --show"),
        (["granular", "--show", "default", "--feedback", "0.2"], "--feedback does nothing with --show"),
        (["granular", "x.pt", "--region", "arms"], "With --region give the --phrase"),
        (["path", "--show", "default", "--wobble", "0.3", "1", "--region", "wings"], "left upper arm"),
        (["map", "--show", "nowhere"], "There is no such show folder"),
    ],
)
def test_a_show_that_cannot_do_it_is_told(arguments: list[str], message: str, tmp_path: Path) -> None:
    result = bunraku(*arguments, "--out", tmp_path / "out.bvh")
    assert result.exit_code == 2 and message in " ".join(result.stderr.split()), result.output


def test_the_map_is_the_one_that_the_show_has_on_stage(tmp_path: Path) -> None:
    opened = open_show(PATH, default_show_path())
    ground = Ground.of(opened.network, opened.dataset)
    middle, directions, low, high = opened.network.ground
    np.testing.assert_array_equal(ground.pose_map.middle, middle)
    np.testing.assert_array_equal(ground.pose_map.directions, directions)
    assert not ground.reach.is_dead and 0 < ground.pose_map.explained <= 1
    inside = (ground.known >= low) & (ground.known <= high)
    assert inside.mean() > 0.7
