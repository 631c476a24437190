"""A small but complete show bundle, with a network that passes its window through."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import write_checksums
from tests.bundles import WINDOW, puppet_inputs, set_facts

NAMES = ("hip", "chest", "lShldr", "lForeArm", "rShldr", "leftEye")
MOVING = NAMES[:5]
SHOW_YAML = """\
name: Test
dancer:
  coding_iterations: 10
  interaction_iterations: 9
motion:
  phrase: phrase.bvh
hands:
  - sensor: left-wrist
    joint: lShldr
"""


def skeleton(names: tuple[str, ...] = NAMES) -> Skeleton:
    offsets = np.array([[0.0, 0.1 * joint, 0.0] for joint in range(len(names))])
    return Skeleton(names, tuple(range(-1, len(names) - 1)), offsets, ((len(names) - 1, (0.0, 0.1, 0.0)),))


def recording(frames: int, bones: Skeleton | None = None, fps: float = 50.0) -> Recording:
    bones = bones or skeleton()
    poses = np.tile([1.0, 0.0, 0.0, 0.0], (frames, len(bones), 1))
    return Recording(bones, poses, np.zeros((frames, 3)), fps)


def save_network(
    path: Path,
    joints: tuple[str, ...] = MOVING,
    facts: dict[str, str] | None = None,
    node: str = "Identity",
    without: str = "",
    targets: list[int] | None = None,
) -> None:
    """A network with a puppet's inputs and outputs; `node` makes the poses out of the window."""
    poses = helper.make_tensor_value_info("poses", TensorProto.FLOAT, ["P", WINDOW, len(joints), 4])
    inputs = [one for one in puppet_inputs(len(joints), targets) if one.name != without]
    graph = helper.make_graph([helper.make_node(node, ["window"], ["poses"])], "puppet", inputs, [poses])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    set_facts(model, joints, **(facts or {}))
    onnx.save(model, str(path))


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """A bundle that has nothing wrong with it."""
    directory = tmp_path / "show"
    directory.mkdir()
    (directory / "show.yaml").write_text(SHOW_YAML)
    write_bvh(directory / "skeleton.bvh", recording(1))
    write_bvh(directory / "phrase.bvh", recording(60))
    save_network(directory / "puppet.onnx")
    (directory / "report.json").write_text("{}")
    write_checksums(directory)
    return directory


@pytest.fixture
def show_yaml(bundle: Path) -> Callable[[str], Path]:
    """Writes another show.yaml into the bundle; gives the bundle's folder."""

    def write(text: str) -> Path:
        (bundle / "show.yaml").write_text(text)
        return bundle

    return write
