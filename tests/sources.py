"""Hand-made motion networks for the small show of `bundles`: what the generator makes its motion with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from appliance.pose import quaternion
from tests.bundles import MOVING, set_facts, write_show

LATENT = 4
SEQUENCE, POSE = 32, 1  # poses of a window
SOURCES: dict[str, dict[str, Any]] = {"vary": {"sigma": 1.0}, "granular": {}, "path": {}}


def write_motion_network(path: Path, window: int, fails: bool = False) -> None:
    """The encoder takes means over time, the decoder bends the rest pose smoothly; both are linear.

    fails: what is decoded is not a number.
    """
    chance, moving = np.random.default_rng(1), len(MOVING)
    rest = np.tile(quaternion.IDENTITY, (window, moving, 1)).astype(np.float32)
    waves = np.sin(np.linspace(0, np.pi, window))[:, None, None] + 1.0
    bends = 0.1 * chance.standard_normal((LATENT, 1, moving, 4)) * waves
    bends[:, :, 0, 1:] *= 0.2  # the hips turn little
    stored = {
        "look": chance.standard_normal((moving * 4, LATENT)),
        "bends": bends.reshape(LATENT, -1),
        "rest": rest.ravel() * (np.nan if fails else 1.0),
    }
    constants = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in stored.items()]
    shapes = {"flat": [-1, window, moving * 4], "shape": [-1, window, moving, 4], "time": [1]}
    constants += [numpy_helper.from_array(np.array(value, np.int64), name) for name, value in shapes.items()]
    nodes = [
        helper.make_node("Reshape", ["windows", "flat"], ["steps"]),
        helper.make_node("ReduceMean", ["steps", "time"], ["mean"], keepdims=0),
        helper.make_node("MatMul", ["mean", "look"], ["coded"]),
        helper.make_node("MatMul", ["latents", "bends"], ["bent"]),
        helper.make_node("Add", ["bent", "rest"], ["whole"]),
        helper.make_node("Reshape", ["whole", "shape"], ["decoded"]),
    ]
    poses, codes = [window, moving, 4], [LATENT]
    ports = {
        "windows": ["w", *poses],
        "latents": ["v", *codes],
        "coded": ["w", *codes],
        "decoded": ["v", *poses],
    }
    infos = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in ports.items()]
    graph = helper.make_graph(nodes, "motion", infos[:2], infos[2:], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)])
    model.ir_version = 9
    ground = (
        json.dumps([[0.0] * LATENT, [[1, 0, 0, 0], [0, 1, 0, 0]], [-2, -2], [2, 2]]) if window == 1 else ""
    )
    set_facts(model, MOVING, kind="motion", window=str(window), latent=str(LATENT), map=ground)
    onnx.save(model, str(path))


def write_show_with_sources(folder: Path, motion: dict[str, Any] | None = None, **sections: Any) -> Path:
    """A show without hands whose phrase can be varied, walked away from, and followed over a map."""
    folder.mkdir(parents=True, exist_ok=True)
    write_motion_network(folder / "sequence.onnx", SEQUENCE)
    write_motion_network(folder / "pose.onnx", POSE)
    return write_show(folder, hands=[], motion=SOURCES | (motion or {}), **sections)
