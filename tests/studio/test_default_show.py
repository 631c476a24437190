"""The show that comes with the box: its report tells the truth about its network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper

from appliance.pose import quaternion
from appliance.show.bundle import default_show_path
from appliance.studio.evaluation.coders import OnnxCoder
from appliance.studio.evaluation.evaluation import evaluate, load_takes
from tests.studio.test_export import pass_of

RANDOM_LATENTS = 2000


@pytest.fixture(scope="module")
def show() -> Path:
    return default_show_path()


@pytest.fixture(scope="module")
def report(show: Path) -> dict[str, Any]:
    text: dict[str, Any] = json.loads((show / "report.json").read_text(encoding="utf-8"))
    return text


def decoder_of(path: Path) -> onnxruntime.InferenceSession:
    """The part of a puppet's pass from the latents to the poses, as a network of its own."""
    model = onnx.load(path)
    one_pass = pass_of(model)
    poses, _, latent = (output.name for output in one_pass.output)
    made_by = {output: node for node in one_pass.node for output in node.output}
    needed, open_names = [], [poses]
    while open_names:
        name = open_names.pop()
        if name != latent and name in made_by and made_by[name] not in needed:
            needed.append(made_by[name])
            open_names += made_by[name].input
    nodes = [node for node in one_pass.node if node in needed]
    size = next(int(entry.value) for entry in model.metadata_props if entry.key == "bunraku.latent")
    inputs = [helper.make_tensor_value_info(latent, TensorProto.FLOAT, ["P", size])]
    used = {name for node in nodes for name in node.input}
    weights = [tensor for tensor in model.graph.initializer if tensor.name in used]
    graph = helper.make_graph(nodes, "decoder", inputs, [one_pass.output[0]], weights)
    alone = helper.make_model(graph, opset_imports=model.opset_import, ir_version=model.ir_version)
    return onnxruntime.InferenceSession(alone.SerializeToString(), providers=["CPUExecutionProvider"])


def test_random_latents_decode_to_poses_as_the_report_says(show: Path, report: dict[str, Any]) -> None:
    coder, decoder = OnnxCoder(show / "puppet.onnx"), decoder_of(show / "puppet.onnx")
    ranges = np.array([report["joint_range_degrees"][name] for name in coder.joints])
    name, size = decoder.get_inputs()[0].name, decoder.get_inputs()[0].shape[1]
    noise = np.random.default_rng(0).standard_normal((RANDOM_LATENTS, 1, size)).astype(np.float32)
    poses = np.concatenate([decoder.run(None, {name: latent})[0] for latent in noise])
    angles = np.degrees(quaternion.angle_between(poses, coder.rest))
    assert angles.max() > 30.0, "the dancer stands still whatever the latent"
    reported, beyond = report["random_latents"], np.maximum(angles - ranges, 0.0)
    assert (beyond == 0).mean() == pytest.approx(reported["share_within_range"], abs=0.01)
    assert beyond.max() == pytest.approx(reported["furthest_beyond_degrees"], abs=10.0)


def test_the_report_is_about_this_network(show: Path, report: dict[str, Any]) -> None:
    coder = OnnxCoder(show / "puppet.onnx")
    assert report["network"]["ships"] == coder.facts["precision"]
    assert report["network"]["architecture"] == coder.facts["architecture"]
    assert tuple(report["joint_range_degrees"]) == coder.joints
    assert not set(report["training"]["takes"]) & set(report["training"]["held_out"])
    assert report["quantization"]["passed"] == (report["network"]["ships"] == "int8")


def test_the_error_on_takes_kept_apart_is_the_report_s(
    show: Path, report: dict[str, Any], recordings_dir: Path
) -> None:
    """What plays on stage, on every eighth window; how good that is stands in the report."""
    coder = OnnxCoder(show / "puppet.onnx")
    files = [recordings_dir / "train" / f"{name}.bvh" for name in report["training"]["held_out"]]
    assert files
    found = evaluate(coder, load_takes(files, coder), hop=8, iterations=(1,)).as_json()
    assert found["degrees"]["1"]["mean"] == pytest.approx(report["degrees"]["1"]["mean"], abs=0.1)
