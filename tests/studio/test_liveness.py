"""Dead networks, truly made: they are told with their cause, by check and by each command that dances so."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from appliance.dancer.material.liveness import network_liveness, what_is_dead
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path, write_checksums
from appliance.studio.autoencoder.architectures import build
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.export import packing
from appliance.studio.export.motion_network import write_motion_network
from tests.cli.test_cli import write_box
from tests.command import Command
from tests.studio.conftest import bunraku as studio

CAUSES = {
    "deaf": "its decoder ignores the latents",
    "collapsed": "none of the 16 numbers of its latent says anything",
    "unlearned": "has not learned the dance",
    "map": "The map is dead: from corner to corner",
}


def made(cause: str, file: Path) -> Path:
    """A network of single poses for the default show, dead in one way; 'map': only its map is."""
    show = default_show_path()
    if cause == "map":
        model = onnx.load(show / "pose.onnx")
        entry = next(one for one in model.metadata_props if one.key == "bunraku.map")
        middle, directions, low, high = json.loads(entry.value)
        entry.value = json.dumps(
            [middle, directions, *((0.1 * np.array(each)).tolist() for each in (low, high))]
        )
        onnx.save(model, file)
        return file
    known = MotionNetwork(show / "pose.onnx", read_bvh(show / "skeleton.bvh").skeleton.names)
    torch.manual_seed(2)
    network, shape = build("mlp", 1, len(known.joints), width=32, latent=16)
    rest = torch.from_numpy(known.rest.copy())
    network.start_at(rest.flatten())
    layers = {
        name: [one for one in getattr(network, name).modules() if isinstance(one, torch.nn.Linear)]
        for name in ("encoder", "decoder")
    }
    for layer in (*layers["encoder"], *layers["decoder"]):
        torch.nn.init.normal_(layer.weight, std=1.0 if layer is not layers["decoder"][-1] else 0.3)
    with torch.no_grad():
        if cause == "deaf":
            layers["decoder"][0].weight.zero_()
        if cause == "collapsed":
            layers["encoder"][-1].weight.zero_()
    middle, ways = np.zeros(16), np.eye(16)[:2]
    ground = json.dumps([middle.tolist(), ways.tolist(), [-2.0, -2.0], [2.0, 2.0]])
    write_motion_network(Autoencoder(network, shape, rest).eval(), known.joints, file, ground)
    return file


def danced() -> tuple[list[str], np.ndarray]:
    phrase = read_bvh(default_show_path() / "phrase.bvh")
    return list(phrase.skeleton.names), phrase.poses


@pytest.mark.parametrize("cause", CAUSES)
def test_each_cause_is_told_with_its_cure(cause: str, tmp_path: Path) -> None:
    names, poses = danced()
    network = MotionNetwork(made(cause, tmp_path / "pose.onnx"), names)
    found = network_liveness(network, poses[:, network.places])
    assert found.cause == ("" if cause == "map" else cause), found
    reported = what_is_dead(network, poses[:, network.places])
    assert CAUSES[cause] in reported
    cure = {"deaf": "--seed", "collapsed": "--latent 8", "unlearned": "--minutes", "map": "--latent 2"}
    assert cure[cause] in reported and sum(each in reported for each in cure.values()) == 1


@pytest.mark.parametrize("name", ["pose.onnx", "sequence.onnx"])
def test_a_network_that_dances_is_called_alive(name: str) -> None:
    names, poses = danced()
    network = MotionNetwork(default_show_path() / name, names)
    assert what_is_dead(network, poses[:, network.places]) == ""


def test_check_map_and_path_say_so(bunraku: Command, tmp_path: Path) -> None:
    show = tmp_path / "show"
    shutil.copytree(default_show_path(), show)
    made("deaf", show / "pose.onnx")
    packing.write_surface(show)
    write_checksums(show)
    out = bunraku("check", show, "--box", write_box(tmp_path)).out
    assert f"pose.onnx: The network is dead: {CAUSES['deaf']}" in " ".join(out.split())
    options = ["--show", show, "--seconds", 1, "--wobble", 1, 1, "--out", tmp_path / "x.bvh"]
    result = studio("path", *options)
    assert result.exit_code == 0 and CAUSES["deaf"] in " ".join(result.stderr.split()), result.output
