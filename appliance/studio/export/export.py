"""The whole iteration as one ONNX graph: Loop, holding, coding and normalisation inside the file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper

from appliance.studio.autoencoder.autoencoder import NEAR, Autoencoder
from appliance.studio.autoencoder.conditional import Conditional
from appliance.studio.export import emit
from appliance.studio.export.graph import MICROSOFT, OPSET, Graph, Layers, info


def export(
    autoencoder: Autoencoder, joints: list[str], path: Path, *, int8: bool, architecture: str
) -> onnx.ModelProto:
    """Write the puppet's network file.

    Inputs: window (T, M, 4), mask (M) bool, targets (T, M, 4), weights (M), coding_iterations and
    interaction_iterations (int64 scalars). Outputs: poses (T, M, 4) unit quaternions, latent (Z) of the last
    pass. What it computes is Autoencoder.iterate, node for node. Precision: float32, or dynamic int8 with u8
    weights per channel. Joint names and sizes travel in the file's metadata.
    """
    shape = autoencoder.shape
    main = Graph()
    facing = _heading(main, shape.window)
    poses = main.op("Concat", "window", "targets", axis=0)  # turned and aligned together
    level = _turned_root(main, poses, facing, inverse=True)
    x, goal = _split_goal(main, _aligned(main, level, autoencoder.rest.cpu().numpy()), shape.window)
    goal = main.op("Mul", goal, main.constant("near", NEAR))
    weight = main.op("Mul", main.op("Cast", "mask", to=TensorProto.FLOAT), "weights")
    held = _held(main, weight, shape.joints)
    gates = _gates(main)
    shares = _gated(main, held, gates)

    body = Graph("pass_", main.constants)
    layers = Layers(int8)
    network = autoencoder.network
    if isinstance(network, Conditional):
        told = emit.condition(main, network, shape, x, goal, weight, gates)
        first, last = (body.op("Gather", biases, "iteration", axis=0) for biases in told)
        own = main.op("Gather", shares, main.constant("own", [0], np.int64), axis=-1)
        seen = body.op("Mul", "x", body.op("Gather", own, "iteration", axis=0))
    else:
        first = last = ""
        seen = _slerp(body, "x", goal, body.op("Gather", shares, "iteration", axis=0))
    latent = emit.encode(body, layers, network, shape, seen, "latent_out", first)
    raw = emit.decode(body, layers, network, shape, latent, last)
    body.op("LpNormalization", raw, out="x_out", axis=-1, p=2)
    loop = helper.make_graph(
        body.nodes,
        "one_coding_iteration",
        [
            info("iteration", [], TensorProto.INT64),
            info("going_on", [], TensorProto.BOOL),
            info("x", [shape.window, shape.joints, 4]),
            info("latent_in", [1, shape.latent]),
        ],
        [
            info("going_on", [], TensorProto.BOOL),  # handed on
            info("x_out", [shape.window, shape.joints, 4]),
            info("latent_out", [1, shape.latent]),
        ],
    )
    nothing = main.constant("no_latent", np.zeros((1, shape.latent)))
    always = main.constant("always", True, np.bool_)
    main.ops("Loop", ["coding_iterations", always, x, nothing], ["coded", "last_latent"], body=loop)
    mirror = main.op(
        "Cast",
        main.op("Not", main.op("Less", "interaction_iterations", "coding_iterations")),
        to=TensorProto.FLOAT,
    )
    shown = _slerp(main, "coded", goal, _gated(main, held, mirror))
    _turned_root(main, shown, facing, inverse=False, out="poses")
    flat = main.constant(f"shape_{shape.latent}", [shape.latent], np.int64)
    main.op("Reshape", "last_latent", flat, out="latent")

    model = _model(main, autoencoder)
    precision = "int8" if int8 else "fp32"
    facts = {
        "joints": ",".join(joints),
        "window": str(shape.window),
        "latent": str(shape.latent),
        "architecture": architecture,
        "precision": precision,
        "rest": json.dumps(np.round(autoencoder.rest.cpu().numpy().astype(float), 7).tolist()),
    }
    for key, value in facts.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = f"bunraku.{key}", value
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return model


def _model(main: Graph, autoencoder: Autoencoder) -> onnx.ModelProto:
    shape = autoencoder.shape
    m = shape.joints
    inputs = [
        info("window", [shape.window, m, 4]),
        info("mask", [m], TensorProto.BOOL),
        info("targets", [shape.window, m, 4]),
        info("weights", [m]),
        info("coding_iterations", [], TensorProto.INT64),
        info("interaction_iterations", [], TensorProto.INT64),
    ]
    outputs = [info("poses", [shape.window, m, 4]), info("latent", [shape.latent])]
    graph = helper.make_graph(main.nodes, "bunraku_puppet", inputs, outputs, main.initializers())
    opsets = [helper.make_opsetid("", OPSET), helper.make_opsetid(MICROSOFT, 1)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=8, producer_name="bunraku")


def _heading(graph: Graph, window: int) -> str:
    """Twist about the vertical (4) of the root joint in the window's middle; a hair of w guards w = y = 0."""
    middle = graph.op("Gather", "window", graph.constant("middle", window // 2, np.int64), axis=0)
    root = graph.op("Gather", middle, graph.constant("first", 0, np.int64), axis=0)
    twist = graph.op("Mul", root, graph.constant("vertical", [1.0, 0.0, 1.0, 0.0]))
    guarded = graph.op("Add", twist, graph.constant("hair", [1e-9, 0.0, 0.0, 0.0]))
    return graph.op("LpNormalization", guarded, axis=-1, p=2)


def _turned_root(graph: Graph, poses: str, facing: str, *, inverse: bool, out: str | None = None) -> str:
    """The root of (P, M, 4) turned by the heading (or back): the product as a 4 x 4 matrix of the heading."""
    sign = -1.0 if inverse else 1.0
    turn = np.zeros((4, 16), dtype=np.float32)  # w and y of the heading -> transposed left matrix, row by row
    turn[0, [0, 5, 10, 15]] = 1.0
    turn[2, [2, 13]] = sign  # w -> y, z -> x
    turn[2, [8, 7]] = -sign  # y -> w, x -> z
    matrix = graph.op("MatMul", facing, graph.constant(f"turn{'_back' if inverse else ''}", turn))
    matrix = graph.op("Reshape", matrix, graph.constant("shape_4x4", [4, 4], np.int64))
    axis, start = graph.constant("axis1", [1], np.int64), graph.constant("at0", [0], np.int64)
    one, end = graph.constant("at1", [1], np.int64), graph.constant("at_end", [1 << 31], np.int64)
    root = graph.op("MatMul", graph.op("Slice", poses, start, one, axis), matrix)
    return graph.op("Concat", root, graph.op("Slice", poses, one, end, axis), out=out, axis=1)


def _aligned(graph: Graph, poses: str, rest: np.ndarray) -> str:
    """Every quaternion in the rest pose's hemisphere."""
    dots = graph.op("Mul", poses, graph.constant("rest", rest))
    dots = graph.op("ReduceSum", dots, graph.constant("axis_last", [-1], np.int64), keepdims=1)
    behind = graph.op("Less", dots, graph.constant("zero", 0.0))
    signs = graph.op("Where", behind, graph.constant("minus", -1.0), graph.constant("plus", 1.0))
    return graph.op("Mul", poses, signs)


def _split_goal(graph: Graph, poses: str, window: int) -> tuple[str, str]:
    x, goal = graph.name("x"), graph.name("goal")
    sizes = graph.constant("window_and_goal", [window, window], np.int64)
    graph.ops("Split", [poses, sizes], [x, goal], axis=0)
    return x, goal


def _held(graph: Graph, weight: str, joints: int) -> str:
    """(1, M, 2): what an interactive pass adds to the shares (1, 0) of pose and target; weight (M)."""
    column = graph.op("Reshape", weight, graph.constant(f"shape_1x{joints}x1", [1, joints, 1], np.int64))
    return graph.op("Mul", column, graph.constant("give_and_take", [[[-1.0, 1.0]]]))


def _gates(graph: Graph) -> str:
    """(K, 1, 1, 1): 1 in the interactive passes, 0 once they are over."""
    zero, one = graph.constant("zero_int", 0, np.int64), graph.constant("one_int", 1, np.int64)
    passes = graph.op("Range", zero, "coding_iterations", one)
    interactive = graph.op("Cast", graph.op("Less", passes, "interaction_iterations"), to=TensorProto.FLOAT)
    return graph.op("Reshape", interactive, graph.constant("shape_column", [-1, 1, 1, 1], np.int64))


def _gated(graph: Graph, held: str, gate: str) -> str:
    """Shares of pose and target (.., M, 2) where a gate is open; (1, 0) where it is closed."""
    return graph.op("Add", graph.op("Mul", held, gate), graph.constant("pose_alone", [[[1.0, 0.0]]]))


def _slerp(graph: Graph, x: str, goal: str, shares: str) -> str:
    """autoencoder.slerp_towards as nodes: x (T, M, 4) towards goal (T, M, 4) by shares (1, M, 2)."""
    dot = graph.op(
        "ReduceSum", graph.op("Mul", x, goal), graph.constant("axis_last", [-1], np.int64), keepdims=1
    )
    angle = graph.op("Acos", graph.op("Abs", dot))
    sines = graph.op("Sin", graph.op("Mul", angle, shares))
    of_x, of_goal = graph.name("of_x"), graph.name("of_goal")
    graph.ops("Split", [sines], [of_x, of_goal], axis=2, num_outputs=2)
    signed = graph.op("Mul", of_goal, graph.op("Sign", dot))
    mixed = graph.op("Add", graph.op("Mul", of_x, x), graph.op("Mul", signed, goal))
    return graph.op("LpNormalization", mixed, axis=-1, p=2)
