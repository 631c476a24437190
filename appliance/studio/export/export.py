"""The whole iteration as one ONNX graph: the passes, holding, coding and normalisation inside the file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper

from appliance.show.network import network_inputs
from appliance.studio.autoencoder.autoencoder import NEAR, Autoencoder
from appliance.studio.autoencoder.coupled import Coupled
from appliance.studio.export import emit
from appliance.studio.export.graph import MICROSOFT, OPSET, Graph, Layers, info


def export(
    autoencoder: Autoencoder, joints: list[str], path: Path, *, int8: bool, architecture: str
) -> onnx.ModelProto:
    """Write the puppets' network file: the windows of P puppets in one run, each with its own iterations.

    Inputs: show.network.network_inputs, P of each; coding_iterations are at least 1. Liveliness, noise,
    places and place_weights are a coupled network's. Outputs: poses (P, T, M, 4) unit quaternions, latent
    (P, Z) of the last pass. It computes Autoencoder.iterate, node for node.
    Precision: float32, or dynamic
    int8 with u8 weights per channel. Joint names and sizes travel in the file's metadata.

    All rows go through as many passes as the one that has most; each is taken as its own last pass left it.
    A coupled network's pass is there twice, with the same constants: while no row has a place weight above 0,
    none looks where the joints are.
    In int8 the rows' activations share a range, so that a row depends a little on the others
    (docs/notebook.md); the same rows give the same bits.
    """
    shape = autoencoder.shape
    main = Graph()
    facing = _heading(main, shape.window)
    poses = main.op("Concat", "window", "targets", axis=1)  # turned and aligned together
    level = _turned_root(main, poses, facing, inverse=True)
    x, goal = _split_goal(main, _aligned(main, level, autoencoder.rest.cpu().numpy()), shape.window)
    goal = main.op("Mul", goal, main.constant("near", NEAR))
    weight = main.op("Mul", main.op("Cast", "mask", to=TensorProto.FLOAT), "weights")
    held = _held(main, weight, shape.joints)
    gates = _gates(main)

    layers = Layers(int8)
    network = autoencoder.network
    if isinstance(network, Coupled):
        zero = main.constant("zero", 0.0)
        is_held = main.op("Cast", main.op("Greater", weight, zero), to=TensorProto.FLOAT)
        meant = _slerp(main, x, goal, _gated(main, _held(main, _whole(main, weight), shape.joints), "plus"))
        pull = emit.pulls(main, layers, network, shape, x, meant, is_held, gates)
        every = _coupled_passes(main, layers, autoencoder, x, pull, gates)
    else:

        def overwritten(body: Graph) -> str:
            seen = _slerp(body, "x", goal, "shares")
            return emit.encode(body, layers, network, shape, seen, "latent_out")

        each_pass = {"shares": _gated(main, held, main.unsqueezed(gates, 2, 3, 4))}
        _, *every = _passes(main, layers, autoencoder, x, each_pass, overwritten)
    coded = main.op("LpNormalization", _last(main, every[0]), axis=-1, p=2)
    _last(main, every[1], out="latent")
    mirror = main.op("Not", main.op("Less", "interaction_iterations", "coding_iterations"))
    mirror = main.unsqueezed(main.op("Cast", mirror, to=TensorProto.FLOAT), 1, 2, 3)
    shown = _slerp(main, coded, goal, _gated(main, held, mirror))
    _turned_root(main, shown, facing, inverse=False, out="poses")

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
    if isinstance(network, Coupled):
        facts["bones"] = _bones(network)
    for key, value in facts.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = f"bunraku.{key}", value
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return model


def _model(main: Graph, autoencoder: Autoencoder) -> onnx.ModelProto:
    shape = autoencoder.shape
    inputs = [
        info(name, ["P", *sizes], helper.np_dtype_to_tensor_dtype(np.dtype(dtype)))
        for name, (dtype, sizes) in network_inputs(shape.joints, shape.latent).items()
    ]
    outputs = [
        info("poses", ["P", shape.window, shape.joints, 4]),
        info("latent", ["P", shape.latent]),
    ]
    graph = helper.make_graph(main.nodes, "bunraku_puppets", inputs, outputs, main.initializers())
    opsets = [helper.make_opsetid("", OPSET), helper.make_opsetid(MICROSOFT, 1)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=8, producer_name="bunraku")


def _passes(
    graph: Graph,
    layers: Layers,
    autoencoder: Autoencoder,
    x: str,
    each_pass: dict[str, str],
    code: Callable[[Graph], str],
) -> list[str]:
    """Passes from windows x: the last windows, and raw windows (K, P, T, M, 4) and latents (K, P, Z) of all.

    each_pass: (K, ..) by the name under which a pass finds its own; code: its nodes from window 'x' to the
    latent 'latent_out'.
    """
    shape, body = autoencoder.shape, Graph(graph.name("pass_"), graph.constants)
    raw = emit.decode(body, layers, autoencoder.network, shape, code(body))
    body.op("LpNormalization", raw, out="x_out", axis=-1, p=2)
    window = [None, shape.window, shape.joints, 4]
    inputs = [info("x", window), *(info(name, None) for name in each_pass)]
    outputs = [info("x_out", window), info(raw, window), info("latent_out", [None, shape.latent])]
    one_pass = helper.make_graph(body.nodes, "one_coding_iteration", inputs, outputs)
    results = [graph.name("x"), graph.name("every_raw"), graph.name("every_latent")]
    graph.ops("Scan", [x, *each_pass.values()], results, body=one_pass, num_scan_inputs=len(each_pass))
    return results


def _coupled_passes(
    main: Graph, layers: Layers, autoencoder: Autoencoder, x: str, pull: str, gates: str
) -> list[str]:
    """The passes of a coupled network; pull (K, P, Z), gates (K, P). The first ones look where joints are.

    These are a Loop, which may have no pass; onnxruntime prepacks its weights. In an If it would not, and all
    passes in there would run a third slower.
    """
    network, shape = autoencoder.network, autoencoder.shape
    assert isinstance(network, Coupled)

    def pulled(body: Graph) -> str:
        coded = emit.encode(body, layers, network, shape, "x", body.name("coded"))
        return body.op("Add", coded, "pull", out="latent_out")

    def stepped(body: Graph) -> str:
        coded = emit.encode(body, layers, network, shape, "x", body.name("coded"))
        own_pull, gate = (body.op("Gather", each, "number", axis=0) for each in (pull, gates))
        step = emit.step_to_places(body, network.places, shape, "x", gate)
        return body.op("Sum", coded, own_pull, step, out="latent_out")

    end, start = (main.constant(*each, np.int64) for each in (("at_end", [1 << 31]), ("at0", [0])))
    count = _passes_with_places(main)
    body = Graph(main.name("led_pass_"), main.constants)
    raw = emit.decode(body, layers, network, shape, stepped(body))
    body.op("LpNormalization", raw, out="x_out", axis=-1, p=2)
    body.op("Identity", "go_on", out="goes_on")
    window = [None, shape.window, shape.joints, 4]
    inputs = [info("number", [], TensorProto.INT64), info("go_on", [], TensorProto.BOOL), info("x", window)]
    outputs = [info("goes_on", [], TensorProto.BOOL), info("x_out", window)]
    outputs += [info(raw, window), info("latent_out", [None, shape.latent])]
    led = helper.make_graph(body.nodes, "one_led_iteration", inputs, outputs)
    between, *before = (main.name(kind) for kind in ("x", "every_raw", "every_latent"))
    main.ops("Loop", [count, "", x], [between, *before], body=led)
    # A Scan needs a pass: after passes that are all led there is one more, which no row takes for its last.
    last = main.op("Sub", main.op("ReduceMax", "coding_iterations"), main.constant("once", [1], np.int64))
    rest = {"pull": main.op("Slice", pull, main.op("Min", count, last), end, start)}
    _, *after = _passes(main, layers, autoencoder, between, rest, pulled)
    return [main.op("Concat", *each, axis=0) for each in zip(before, after, strict=True)]


def _passes_with_places(graph: Graph) -> str:
    """(1,): in how many passes a row has an interaction with a joint at a place."""
    axis_last = graph.constant("axis_last", [-1], np.int64)
    most = graph.op("ReduceMax", "place_weights", axis_last, keepdims=0)
    placed = graph.op("Greater", most, graph.constant("zero", 0.0))
    times = graph.op("Where", placed, "interaction_iterations", graph.constant("zero_int", 0, np.int64))
    return graph.op("Min", graph.op("ReduceMax", times), graph.op("ReduceMax", "coding_iterations"))


def _bones(network: Coupled) -> str:
    """Parents, turns and reaches of the moving joints as JSON."""
    parents, *others = network.places.bones
    return json.dumps([parents, *(np.round(each.numpy().astype(float), 7).tolist() for each in others)])


def _last(graph: Graph, every: str, out: str | None = None) -> str:
    """The result of each row's own last pass: (K, P, ..) -> (P, ..)."""
    turned = graph.op("ReverseSequence", every, "coding_iterations", time_axis=0, batch_axis=1)
    return graph.op("Gather", turned, graph.constant("first", 0, np.int64), out=out, axis=0)


def _heading(graph: Graph, window: int) -> str:
    """Twists about the vertical (P, 4) of the root joint in the middle of each window; a hair of w guards
    w = y = 0.
    """
    middle = graph.op("Gather", "window", graph.constant("middle", window // 2, np.int64), axis=1)
    root = graph.op("Gather", middle, graph.constant("first", 0, np.int64), axis=1)
    twist = graph.op("Mul", root, graph.constant("vertical", [1.0, 0.0, 1.0, 0.0]))
    guarded = graph.op("Add", twist, graph.constant("hair", [1e-9, 0.0, 0.0, 0.0]))
    return graph.op("LpNormalization", guarded, axis=-1, p=2)


def _turned_root(graph: Graph, poses: str, facing: str, *, inverse: bool, out: str | None = None) -> str:
    """The roots of (P, N, M, 4) turned by the headings (or back): products as 4 x 4 matrices of these."""
    sign = -1.0 if inverse else 1.0
    turn = np.zeros((4, 16), dtype=np.float32)  # w and y of the heading -> transposed left matrix, row by row
    turn[0, [0, 5, 10, 15]] = 1.0
    turn[2, [2, 13]] = sign  # w -> y, z -> x
    turn[2, [8, 7]] = -sign  # y -> w, x -> z
    matrix = graph.op("MatMul", facing, graph.constant(f"turn{'_back' if inverse else ''}", turn))
    matrix = graph.op("Reshape", matrix, graph.constant("shape_Px1x4x4", [-1, 1, 4, 4], np.int64))
    axis, start = graph.constant("axis2", [2], np.int64), graph.constant("at0", [0], np.int64)
    one, end = graph.constant("at1", [1], np.int64), graph.constant("at_end", [1 << 31], np.int64)
    root = graph.op("MatMul", graph.op("Slice", poses, start, one, axis), matrix)
    return graph.op("Concat", root, graph.op("Slice", poses, one, end, axis), out=out, axis=2)


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
    graph.ops("Split", [poses, sizes], [x, goal], axis=1)
    return x, goal


def _held(graph: Graph, weight: str, joints: int) -> str:
    """(P, 1, M, 2): what an interactive pass adds to the shares (1, 0) of pose and target; weight (P, M)."""
    shape = graph.constant(f"shape_Px1x{joints}x1", [-1, 1, joints, 1], np.int64)
    column = graph.op("Reshape", weight, shape)
    return graph.op("Mul", column, graph.constant("give_and_take", [[[-1.0, 1.0]]]))


def _whole(graph: Graph, weight: str) -> str:
    """(P, M): how far all interactions together bring a joint; weight (P, M): by how much one does."""
    one = graph.constant("plus", 1.0)
    least = graph.op(
        "Max", graph.unsqueezed("interaction_iterations", 1), graph.constant("once", [1], np.int64)
    )
    times = graph.op("Cast", least, to=TensorProto.FLOAT)
    return graph.op("Sub", one, graph.op("Pow", graph.op("Sub", one, weight), times))


def _gates(graph: Graph) -> str:
    """(K, P): 1 in the interactive passes of each row, 0 once they are over."""
    passes = graph.unsqueezed(emit.passes(graph), 1)
    return graph.op("Cast", graph.op("Less", passes, "interaction_iterations"), to=TensorProto.FLOAT)


def _gated(graph: Graph, held: str, gate: str) -> str:
    """Shares of pose and target (.., M, 2) where a gate is open; (1, 0) where it is closed."""
    return graph.op("Add", graph.op("Mul", held, gate), graph.constant("pose_alone", [[[1.0, 0.0]]]))


def _slerp(graph: Graph, x: str, goal: str, shares: str) -> str:
    """autoencoder.slerp_towards as nodes: x (P, T, M, 4) towards goal, by shares (P, 1, M, 2) of both."""
    dot = graph.op(
        "ReduceSum", graph.op("Mul", x, goal), graph.constant("axis_last", [-1], np.int64), keepdims=1
    )
    angle = graph.op("Acos", graph.op("Abs", dot))
    sines = graph.op("Sin", graph.op("Mul", angle, shares))
    of_x, of_goal = graph.name("of_x"), graph.name("of_goal")
    graph.ops("Split", [sines], [of_x, of_goal], axis=-1, num_outputs=2)
    signed = graph.op("Mul", of_goal, graph.op("Sign", dot))
    mixed = graph.op("Add", graph.op("Mul", of_x, x), graph.op("Mul", signed, goal))
    return graph.op("LpNormalization", mixed, axis=-1, p=2)
