"""Ten coding iterations, nine of them interactive, on one window: the default and the paper's network.

Weights are random: speed does not depend on them. The shipped default is measured besides, as it ships.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from appliance.dancer.puppet import PuppetNetwork
from appliance.pose.bvh import read_bvh
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import default_show_path
from appliance.studio.autoencoder.architectures import build
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.autoencoder.models import PUPPETS
from appliance.studio.export.export import export
from tests.studio.tiny import moving, skeleton, swaying

GROUP = "ten coding iterations, one thread"
NAMES = [skeleton().names[j] for j in moving()]
TITLES = {
    "coupled": "default",
    "mlp": "plain mlp",
    "lstm": "paper's LSTM",
}


def untrained(network: str) -> Autoencoder:
    """A network at its full size with random weights."""
    torch.manual_seed(0)
    built, shape = build(network, 8, len(NAMES))
    rest = torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(len(NAMES), 1)
    return Autoencoder(built, shape, rest).requires_grad_(False).eval()


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Path]:
    folder = tmp_path_factory.mktemp("networks")

    def file(network: str, precision: str) -> Path:
        path = folder / f"{network}-{precision}.onnx"
        if not path.exists():
            export(untrained(network), NAMES, path, int8=precision == "int8", architecture=network)
        return path

    return file


@pytest.fixture
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def inputs(joints: int) -> tuple[Any, ...]:
    """A window of smooth movement, one joint held."""
    window = np.ascontiguousarray(swaying(1.0).poses[:8, moving()[:joints]], dtype=np.float32)
    mask = np.zeros(joints, dtype=bool)
    mask[8] = True
    targets = np.tile(np.array([0.8, 0.6, 0.0, 0.0], dtype=np.float32), (8, joints, 1))
    return window, mask, targets, np.ones(joints, dtype=np.float32)


def held(network: Path, figure: Skeleton, puppets: int = 1) -> PuppetNetwork:
    """A network whose puppets each have a window and a hand."""
    dancers = PuppetNetwork(network, figure, puppets)
    window, mask, targets, weights = inputs(len(dancers.joints))
    for one in dancers.puppets:
        one.window[:] = window
        one.hold(mask, targets, weights, 10, 9)
    return dancers


@pytest.mark.filterwarnings("ignore:TF32 acceleration")  # torch's switch for oneDNN speaks of Intel's GPUs
@pytest.mark.parametrize("onednn", [True, False], ids=["defaults", "oneDNN-off"])
def test_pytorch_eager(measured: Callable[..., Any], one_thread: None, onednn: bool) -> None:
    """The seed authors' way. Its default is handicapped by oneDNN at batch 1, so both are measured."""
    autoencoder = untrained("lstm")
    window, mask, targets, weights = (torch.from_numpy(value) for value in inputs(len(NAMES)))
    label = "PyTorch eager" if onednn else "PyTorch eager, oneDNN off"
    benchmark = measured(label, GROUP, reference=True)
    with torch.backends.mkldnn.flags(enabled=onednn), torch.no_grad():
        made, _ = benchmark.pedantic(
            autoencoder.iterate,
            (window[None], 10, 9, HeldJoints(mask, targets, weights)),
            rounds=15,
            warmup_rounds=2,
        )
    assert made.shape == (1, 8, len(NAMES), 4)


@pytest.mark.parametrize("precision", ["fp32", "int8"])
@pytest.mark.parametrize("network", sorted(PUPPETS))
def test_exported(
    measured: Callable[..., Any], exported: Callable[[str, str], Path], network: str, precision: str
) -> None:
    dancer = held(exported(network, precision), skeleton())
    benchmark = measured(f"{TITLES.get(network, network)}, {precision}", GROUP)
    benchmark.pedantic(dancer.dance, rounds=40 if "lstm" in network else 400, warmup_rounds=5)
    assert not dancer.puppets[0].is_broken


def test_the_default_as_it_ships(measured: Callable[..., Any]) -> None:
    show = default_show_path()
    dancer = held(show / "puppet.onnx", read_bvh(show / "skeleton.bvh").skeleton)
    measured(f"default as it ships, {dancer.precision}", GROUP).pedantic(
        dancer.dance, rounds=400, warmup_rounds=5
    )
    assert not dancer.puppets[0].is_broken


@pytest.mark.parametrize("puppets", [1, 2, 4])
def test_several_in_one_run(measured: Callable[..., Any], puppets: int) -> None:
    """All puppets in one run of the network, each with a hand."""
    show = default_show_path()
    dancers = held(show / "puppet.onnx", read_bvh(show / "skeleton.bvh").skeleton, puppets)
    benchmark = measured(f"{puppets} of them", "puppets as they ship, in one run", reference=puppets == 1)
    benchmark.pedantic(dancers.dance, rounds=400, warmup_rounds=5)
    assert not any(one.is_broken for one in dancers.puppets)
