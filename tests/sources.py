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
SOURCES: dict[str, dict[str, Any]] = {
    "vary": {"sigma": 1.0},
    "granular": {},
    "path": {},
    "improvise": {"seconds": 5.0},
}


def write_motion_network(path: Path, window: int, fails: bool = False) -> None:
    """The encoder takes means over time, the decoder bends the rest pose smoothly; both are linear.

    fails: what is decoded is not a number.
    """
    ground = [[0.0] * LATENT, [[1, 0, 0, 0], [0, 1, 0, 0]], [-2, -2], [2, 2]]
    _write(path, *_coder(window, fails), kind="motion", window=window, map=ground if window == 1 else "")


def write_improviser_network(path: Path) -> None:
    """Each move leads towards the rest pose, and away from it as its code says; the height stays."""
    chance, steps, code, mixtures, many = np.random.default_rng(2), LATENT + 4, 3, 2, ["b"]
    nodes, stored, inputs, outputs = _coder(8)
    keep, away = np.full(steps, 0.9), 0.3 * chance.standard_normal((code, steps))
    keep[-1], away[:, -1], away[:, -4:-1] = 1.0, 0.0, 0.05 * away[:, -4:-1]
    stored |= {
        "keep": keep,
        "away": away,
        "ramp": np.linspace(0.1, 1.0, 8)[:, None],
        "look_at_move": chance.standard_normal((steps, code)),
        "foresee": 0.3 * chance.standard_normal((code, mixtures * (2 * code + 1))),
    }
    stored |= {"last": np.array([2]), "middle": np.array([1]), "steps_axis": np.array([1])}
    nodes += [
        helper.make_node("ReduceMean", ["move_heard", "steps_axis"], ["heard"], keepdims=0),
        helper.make_node("MatMul", ["heard", "look_at_move"], ["code_of_move"]),
        helper.make_node("MatMul", ["last_code", "foresee"], ["mixture"]),
        helper.make_node("Tanh", ["cells"], ["later_cells"]),
        helper.make_node("Gather", ["steps_before", "last"], ["from"], axis=1),
        helper.make_node("Mul", ["from", "keep"], ["kept"]),
        helper.make_node("MatMul", ["next_code", "away"], ["aim"]),
        helper.make_node("Unsqueeze", ["aim", "middle"], ["aims"]),
        helper.make_node("Mul", ["aims", "ramp"], ["led"]),
        helper.make_node("Add", ["kept", "led"], ["next_move"]),
    ]
    inputs |= {"steps_heard": [*many, 3, steps], "move_heard": [*many, 8, steps]}
    inputs |= {"steps_before": ["n", 3, steps], "next_code": ["n", code]}
    inputs |= {"last_steps": ["f", 3, steps], "last_code": ["f", code], "cells": ["f", 2]}
    outputs |= {"code_of_move": [*many, code], "next_move": ["n", 8, steps]}
    outputs |= {"mixture": ["f", mixtures * (2 * code + 1)], "later_cells": ["f", 2]}
    _write(path, nodes, stored, inputs, outputs, kind="improviser", window=8, mixtures=mixtures)


def write_partner_network(path: Path) -> None:
    """A move scores by how alike its last step and the other's are, and is natural by how near it is to
    `who`; a code goes where the other went, as its noise says.
    """
    chance, steps, code, dancers = np.random.default_rng(3), LATENT + 4, 3, 2
    stored: dict[str, np.ndarray[Any, Any]] = {
        "see": 0.3 * chance.standard_normal((steps, code)),
        "name": chance.standard_normal((steps, dancers)),
        "newest": np.array([15]),
        "end": np.array([10]),
        "flat": np.array([-1, steps]),
        "list": np.array([-1]),
        "turn": np.array([1]),
    }
    nodes = [
        helper.make_node("Gather", ["led", "newest"], ["last_led"], axis=1),
        helper.make_node("Reshape", ["last_led", "flat"], ["other"]),
        helper.make_node("Gather", ["moves", "end"], ["last_move"], axis=1),
        helper.make_node("Reshape", ["last_move", "flat"], ["last_own"]),
        helper.make_node("Transpose", ["other"], ["upright"], perm=[1, 0]),
        helper.make_node("MatMul", ["last_own", "upright"], ["product"]),
        helper.make_node("Reshape", ["product", "list"], ["scores"]),
        helper.make_node("MatMul", ["last_own", "name"], ["names"]),
        helper.make_node("Mul", ["names", "who"], ["of_who"]),
        helper.make_node("ReduceMean", ["of_who", "turn"], ["natural"], keepdims=0),
        helper.make_node("ReduceMean", ["own", "turn"], ["stood"], keepdims=0),
        helper.make_node("MatMul", ["stood", "name"], ["alike"]),
        helper.make_node("Mul", ["other", "heard"], ["heard_of"]),
        helper.make_node("Add", ["heard_of", "stood"], ["seen"]),
        helper.make_node("MatMul", ["seen", "see"], ["aim_at"]),
        helper.make_node("Add", ["noise", "aim_at"], ["codes"]),
    ]
    inputs: Ports = {"led": ["l", 16, steps], "moves": ["n", 11, steps], "own": ["o", 11, steps]}
    inputs |= {"heard": ["h", 1], "who": ["w", dancers], "noise": ["c", code]}
    outputs: Ports = {"scores": ["n"], "natural": ["n"], "alike": ["o", dancers], "codes": ["c", code]}
    _write(path, nodes, stored, inputs, outputs, kind="partner", window=8)


Ports = dict[str, list[Any]]
Parts = tuple[list[onnx.NodeProto], dict[str, np.ndarray[Any, Any]], Ports, Ports]


def _coder(window: int, fails: bool = False) -> Parts:
    chance, moving = np.random.default_rng(1), len(MOVING)
    rest = np.tile(quaternion.IDENTITY, (window, moving, 1)).astype(np.float32)
    waves = np.sin(np.linspace(0, np.pi, window))[:, None, None] + 1.0
    bends = 0.1 * chance.standard_normal((LATENT, 1, moving, 4)) * waves
    bends[:, :, 0, 1:] *= 0.2  # the hips turn little
    stored = {
        "look": chance.standard_normal((moving * 4, LATENT)),
        "bends": bends.reshape(LATENT, -1),
        "rest": rest.ravel() * (np.nan if fails else 1.0),
        "flat": np.array([-1, window, moving * 4]),
        "shape": np.array([-1, window, moving, 4]),
        "time": np.array([1]),
    }
    nodes = [
        helper.make_node("Reshape", ["windows", "flat"], ["steps"]),
        helper.make_node("ReduceMean", ["steps", "time"], ["mean"], keepdims=0),
        helper.make_node("MatMul", ["mean", "look"], ["coded"]),
        helper.make_node("MatMul", ["latents", "bends"], ["bent"]),
        helper.make_node("Add", ["bent", "rest"], ["whole"]),
        helper.make_node("Reshape", ["whole", "shape"], ["decoded"]),
    ]
    poses = [window, moving, 4]
    inputs = {"windows": ["w", *poses], "latents": ["v", LATENT]}
    return nodes, stored, inputs, {"coded": ["w", LATENT], "decoded": ["v", *poses]}


def _write(
    path: Path,
    nodes: list[onnx.NodeProto],
    stored: dict[str, np.ndarray[Any, Any]],
    inputs: Ports,
    outputs: Ports,
    **facts: Any,
) -> None:
    constants = [
        numpy_helper.from_array(value.astype(np.int64 if value.dtype.kind == "i" else np.float32), name)
        for name, value in stored.items()
    ]
    sides = [
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in side.items()]
        for side in (inputs, outputs)
    ]
    graph = helper.make_graph(nodes, "motion", *sides, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)])
    model.ir_version = 9
    said = {name: fact if isinstance(fact, str) else json.dumps(fact) for name, fact in facts.items()}
    set_facts(model, MOVING, latent=str(LATENT), **said)
    onnx.save(model, str(path))


def write_show_with_sources(folder: Path, motion: dict[str, Any] | None = None, **sections: Any) -> Path:
    """A show without hands whose phrase can be varied, walked away from, followed over a map, continued."""
    folder.mkdir(parents=True, exist_ok=True)
    write_motion_network(folder / "sequence.onnx", SEQUENCE)
    write_motion_network(folder / "pose.onnx", POSE)
    write_improviser_network(folder / "improviser.onnx")
    write_partner_network(folder / "partner.onnx")
    return write_show(folder, hands=[], motion=SOURCES | (motion or {}), **sections)
