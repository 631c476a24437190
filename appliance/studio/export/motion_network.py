"""A pose or sequence model as a file of a show: encoder and decoder for the box's sources of motion."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

from appliance.dancer.material.motion_network import MotionNetwork, map_facts
from appliance.pose.whole_file import written_whole
from appliance.studio.autoencoder import networks
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.data.dataset import Dataset
from appliance.studio.evaluation.coders import TorchCoder
from appliance.studio.export import emit
from appliance.studio.export.graph import MICROSOFT, OPSET, Graph, Layers, info
from appliance.studio.pose_space.latent_poses import PoseMap
from appliance.studio.pose_space.pose_model import training_poses
from appliance.studio.studio_error import StudioError

FILES = {"pose": "pose.onnx", "sequence": "sequence.onnx"}  # by model, as show.yaml calls them
_SMALL = 1024  # numbers: constants of this size stay in full precision
_EDGE = 1.0  # percent of the recorded poses that lie outside of the map on each side
_ROUNDING = 0.02  # most that 16-bit weights may change of any component


def export_motion(coder: TorchCoder, dataset: Dataset, model: str, folder: Path) -> Path:
    """Write the network's file, weights in 16 bits. Raises StudioError where it is not the trained one."""
    path = folder / FILES[model]
    ground = _map(coder.autoencoder, dataset) if model == "pose" else ""
    few = torch.randn(4, coder.autoencoder.shape.latent, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        trained = coder.autoencoder.decode_raw(few).numpy()
    with written_whole(path) as written:
        write_motion_network(coder.autoencoder, coder.joints, written, ground)
        played = MotionNetwork(written, coder.joints).decode(few.numpy())
        require_as_trained("network", float(np.abs(played - trained).max()), _ROUNDING)
    return path


def require_as_trained(name: str, difference: float, most: float) -> None:
    """Raises StudioError for a file that differs more from what was trained."""
    if not difference <= most:
        raise StudioError(
            f"The exported {name} differs from the trained one by {difference:.1g}. No file was written. "
            "This is a bug in the export: report it."
        )


def write_motion_network(
    autoencoder: Autoencoder, joints: Sequence[str], path: Path, ground: str = ""
) -> onnx.ModelProto:
    """Inputs: windows (W, T, M, 4) that face ahead, in the rest pose's hemisphere; latents (V, Z). Outputs:
    coded (W, Z), decoded (V, T, M, 4), not yet of unit length. Raises StudioError for an LSTM.
    """
    graph = Graph()
    ports = coder_nodes(graph, Layers(int8=False), autoencoder)
    model = checked_model(graph, ports, motion_facts(autoencoder, joints) | {"map": ground})
    path.write_bytes(model.SerializeToString())
    return model


class Port(NamedTuple):
    """An input or output of a file: many (the name of how many) arrays of these sizes."""

    name: str
    many: str
    sizes: list[int]


def coder_nodes(graph: Graph, layers: Layers, autoencoder: Autoencoder) -> tuple[list[Port], list[Port]]:
    """Nodes of an mlp's encoder and decoder; its inputs and outputs. Raises StudioError for other kinds."""
    shape, network = autoencoder.shape, autoencoder.network
    encoder, decoder = network.encoder, network.decoder
    if not isinstance(encoder, networks.MlpEncoder) or not isinstance(decoder, networks.MlpDecoder):
        raise StudioError(
            "The box's sources of motion take only networks of the kind mlp: train the model with its "
            "default network."
        )
    basis = graph.constant("curves", encoder.time.curves.numpy())
    steps = graph.op("Reshape", "windows", sizes_of(graph, -1, shape.window, shape.pose))
    amounts = graph.op("MatMul", basis, steps)
    flat = graph.op("Reshape", amounts, sizes_of(graph, -1, shape.curves * shape.pose))
    coded = emit.dense_stack(graph, layers, encoder.stack, flat, "encoder")
    first, last = (graph.constant(f"at_{at}", [at], np.int64) for at in (0, shape.latent))
    graph.op("Slice", coded, first, last, graph.constant("last_axis", [1], np.int64), out="coded")
    drawn = emit.dense_stack(graph, layers, decoder.stack, "latents", "decoder")
    drawn = graph.op("Reshape", drawn, sizes_of(graph, -1, shape.curves, shape.pose))
    back = graph.op("MatMul", graph.constant("curves_back", decoder.time.curves.numpy().T), drawn)
    graph.op("Reshape", back, sizes_of(graph, -1, shape.window, shape.joints, 4), out="decoded")
    window = [shape.window, shape.joints, 4]
    return (
        [Port("windows", "w", window), Port("latents", "v", [shape.latent])],
        [Port("coded", "w", [shape.latent]), Port("decoded", "v", window)],
    )


def motion_facts(autoencoder: Autoencoder, joints: Sequence[str]) -> dict[str, str]:
    """The box's facts about an autoencoder."""
    return {
        "kind": "motion",
        "joints": ",".join(joints),
        "window": str(autoencoder.shape.window),
        "latent": str(autoencoder.shape.latent),
        "rest": json.dumps(np.round(autoencoder.rest.cpu().numpy().astype(float), 7).tolist()),
    }


def checked_model(
    graph: Graph, ports: tuple[list[Port], list[Port]], facts: dict[str, str]
) -> onnx.ModelProto:
    """Large constants are stored in 16 bits and widened when the file is loaded."""
    nodes: list[onnx.NodeProto] = []
    stored: list[onnx.TensorProto] = []
    for name, value in graph.constants.items():
        if value.dtype == np.float32 and value.size > _SMALL:
            stored.append(numpy_helper.from_array(value.astype(np.float16), f"{name}.16"))
            nodes.append(helper.make_node("Cast", [f"{name}.16"], [name], to=TensorProto.FLOAT))
        else:
            stored.append(numpy_helper.from_array(np.array(value, order="C"), name))
    inputs, outputs = ([_many(*port) for port in side] for side in ports)
    made = helper.make_graph([*nodes, *graph.nodes], "bunraku_motion", inputs, outputs, stored)
    opsets = [helper.make_opsetid("", OPSET), helper.make_opsetid(MICROSOFT, 1)]
    model = helper.make_model(made, opset_imports=opsets, ir_version=8, producer_name="bunraku")
    for key, fact in facts.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = f"bunraku.{key}", fact
    onnx.checker.check_model(model)
    return model


def _many(name: str, count: str, sizes: list[int]) -> onnx.ValueInfoProto:
    return info(name, [count, *sizes])  # a dimension left open has a name


def sizes_of(graph: Graph, *sizes: int) -> str:
    """A shape as a constant."""
    return graph.constant("shape_" + "x".join(map(str, sizes)), sizes, np.int64)


def _map(autoencoder: Autoencoder, dataset: Dataset) -> str:
    """Where the map's 0 and 1 lie: nearly all recorded poses are between them."""
    latents, figures = training_poses(autoencoder, dataset)
    found = PoseMap.of(latents, figures, 2)
    low, high = np.percentile(found.points(latents), [_EDGE, 100 - _EDGE], axis=0)
    return map_facts(found.middle, found.directions, low, high)
