"""Small show bundles, made without torch: a swaying phrase, a hand-made network."""

from __future__ import annotations

import functools
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import yaml
from onnx import TensorProto, helper

from appliance.body.mesh_file import MESH_FILE, write_mesh
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.network import WINDOW, network_inputs

FIGURE = Skeleton(
    ("Hips", "Chest", "lShldr", "lForeArm", "lThigh", "lFoot", "rThigh", "rFoot"),
    (-1, 0, 1, 2, 0, 4, 0, 6),
    np.array(
        [
            *([0, 0, 0], [0, 0.4, 0], [0.2, 0.1, 0], [0.3, 0, 0]),
            *([0.1, -0.1, 0], [0, -0.8, 0], [-0.1, -0.1, 0], [0, -0.8, 0]),
        ],
        float,
    ),
    ((3, (0.25, 0.0, 0.0)), (5, (0.0, -0.05, 0.1)), (7, (0.0, -0.05, 0.1))),
)
MOVING = ("Hips", "Chest", "lShldr", "lForeArm", "lThigh", "rThigh")
WORN = {"sensor": "left-wrist", "joint": "lShldr"}


def write_show(
    folder: Path,
    hands: list[dict[str, object]] | None = None,
    network: str = "plain",
    name: str = "A test",
    **sections: Any,
) -> Path:
    """A bundle with a phrase of three seconds; `sections`: more of show.yaml. Networks: plain (shows the
    targets), broken (not a number), fragile (not a number at seven coding iterations), heavy (takes ms)."""
    folder.mkdir(parents=True, exist_ok=True)
    phrase = swaying_phrase()
    write_bvh(folder / "phrase.bvh", phrase)
    write_bvh(folder / "skeleton.bvh", phrase.excerpt(0.0, 0.02))
    onnx.save(_network(network), str(folder / "puppet.onnx"))
    show = {
        "name": name,
        "dancer": {"coding_iterations": 3, "interaction_iterations": 2},
        "hands": [WORN] if hands is None else hands,
        **sections,
    }
    (folder / "show.yaml").write_text(yaml.safe_dump(show))
    return folder


def with_surface(show: Path) -> Path:
    """The figure's surface beside a show, as `bunraku pack` writes it: else each projector models it."""
    (show / MESH_FILE).write_bytes(_surface())
    return show


@functools.cache
def _surface() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write_mesh(Path(folder), FIGURE)
        return (Path(folder) / MESH_FILE).read_bytes()


def swaying_phrase(seconds: float = 3.0) -> Recording:
    """The chest leans left and right, once a second."""
    count = round(50 * seconds)
    poses = np.tile(quaternion.IDENTITY.astype(np.float64), (count, len(FIGURE), 1))
    angle = 0.3 * np.sin(2 * np.pi * np.arange(count) / 50)
    poses[:, FIGURE.index("Chest")] = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), angle)
    return Recording(FIGURE, poses, np.tile([0.0, 0.95, 0.0], (count, 1)), 50.0)


def puppet_inputs(joints: int, targets: list[int] | None = None) -> list[onnx.ValueInfoProto]:
    """The inputs of a puppet's network with this many moving joints; `targets`: another shape of these."""
    shapes: dict[str, tuple[int, Sequence[int | str]]] = {
        name: (helper.np_dtype_to_tensor_dtype(np.dtype(dtype)), ["P", *shape])
        for name, (dtype, shape) in network_inputs(joints, 1).items()
    }
    if targets is not None:
        shapes["targets"] = TensorProto.FLOAT, targets
    return [helper.make_tensor_value_info(name, *shape) for name, shape in shapes.items()]


def set_facts(model: onnx.ModelProto, joints: Sequence[str], /, **more: str) -> None:
    """Write into a network which joints it moves, at rest unrotated, and more facts."""
    rest = np.tile(quaternion.IDENTITY, (len(joints), 1)).tolist()
    sizes = {"window": str(WINDOW), "latent": "1"}
    facts = {"joints": ",".join(joints), **sizes, "rest": json.dumps(rest), **more}
    helper.set_model_props(model, {f"bunraku.{name}": fact for name, fact in facts.items()})


def _network(kind: str) -> onnx.ModelProto:
    """Held joints show their targets, the others the window; `broken` divides by nothing."""
    moving = len(MOVING)
    outputs = [
        helper.make_tensor_value_info("poses", TensorProto.FLOAT, ["P", WINDOW, moving, 4]),
        helper.make_tensor_value_info("latent", TensorProto.FLOAT, ["P", 1]),
    ]
    constants = [
        helper.make_tensor("window_and_last", TensorProto.INT64, [2], [1, 3]),
        helper.make_tensor("all_but_puppet", TensorProto.INT64, [3], [1, 2, 3]),
        helper.make_tensor("last", TensorProto.INT64, [1], [1]),
        helper.make_tensor("half", TensorProto.FLOAT, [], [0.5]),
        helper.make_tensor("seven", TensorProto.FLOAT, [], [7.0]),
        helper.make_tensor("all", TensorProto.FLOAT, [], [0.0 if kind == "broken" else 1.0]),
    ]
    nodes = [
        helper.make_node("Unsqueeze", ["mask", "window_and_last"], ["mask_column"]),
        helper.make_node("Unsqueeze", ["weights", "window_and_last"], ["weight_column"]),
        helper.make_node("Greater", ["weight_column", "half"], ["firm"]),
        helper.make_node("And", ["mask_column", "firm"], ["held"]),
        helper.make_node("Where", ["held", "targets", "window"], ["shown"]),
        helper.make_node("Cast", ["coding_iterations"], ["coding"], to=TensorProto.FLOAT),
        helper.make_node("Sub", ["coding", "seven"], ["from_seven_flat"]),
        helper.make_node("Unsqueeze", ["from_seven_flat", "all_but_puppet"], ["from_seven"]),
        helper.make_node("Identity", ["from_seven" if kind == "fragile" else "all"], ["scale"]),
        helper.make_node("Mul", ["shown", "scale"], ["scaled"]),
        helper.make_node("Div", ["scaled", "scale"], ["poses"]),
        helper.make_node("Cast", ["interaction_iterations"], ["interaction"], to=TensorProto.FLOAT),
        helper.make_node("Add", ["coding", "interaction"], ["sum"]),
        helper.make_node("Unsqueeze", ["sum", "last"], ["latent" if kind != "heavy" else "light"]),
    ]
    if kind == "heavy":  # three products of 400 x 400 matrices: some milliseconds everywhere
        constants.append(helper.make_tensor("square", TensorProto.INT64, [2], np.array([400, 400])))
        nodes += [
            helper.make_node("ReduceMax", ["light"], ["number"], keepdims=0),
            helper.make_node("Expand", ["number", "square"], ["matrix0"]),
            *(helper.make_node("MatMul", [f"matrix{k}", f"matrix{k}"], [f"matrix{k + 1}"]) for k in range(3)),
            helper.make_node("ReduceMax", ["matrix3"], ["largest"], keepdims=0),
            helper.make_node("Add", ["light", "largest"], ["latent"]),
        ]
    graph = helper.make_graph(nodes, kind, puppet_inputs(moving), outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 9
    set_facts(model, MOVING, architecture=kind, precision="fp32")
    return model
