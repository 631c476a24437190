"""Each architecture's encoder and decoder as ONNX nodes.

P windows enter as (P, T, M, 4) and leave as (P, T, M, 4) before normalisation; the latents are (P, Z).

Two kinds of dense layers stay in float, also in int8 files. One is the layer that sees the pose itself: eight
bits over the range of whole orientations are a step of 1.2 degrees. Quantized, that layer made 0.59 of the
0.61 degrees of difference to float after one iteration of the default. The others are the two around the
latent: they are so small that int8 saves no time, and would make a third of the difference that is left.
"""

from __future__ import annotations

import numpy as np
from onnx import TensorProto
from torch import nn

from appliance.studio.autoencoder import networks
from appliance.studio.autoencoder.coupled import (
    BODY,
    CALM,
    LONGEST_STEP,
    NOISE,
    STEP,
    Coupled,
    HandEncoder,
    MeanLatent,
    PlaceEncoder,
    matrix_of_products,
)
from appliance.studio.autoencoder.networks import Network, Shape
from appliance.studio.autoencoder.rotation import Bones
from appliance.studio.export.graph import Graph, Layers

EXACT = Layers(int8=False)


def encode(
    graph: Graph, layers: Layers, network: Network, shape: Shape, window: str, out: str, bias: str = ""
) -> str:
    """Nodes of the encoder: windows (P, T, M, 4) -> latents (P, Z), named out; bias (P, W): of its first
    layer.
    """
    encoder = network.encoder
    if isinstance(encoder, networks.MlpEncoder):
        steps = _reshaped(graph, window, -1, shape.window, shape.pose)
        basis = graph.constant("curves", encoder.time.curves.numpy())
        amounts = _reshaped(graph, graph.op("MatMul", basis, steps), -1, shape.curves * shape.pose)
        return dense_stack(graph, layers, encoder.stack, amounts, "encoder", out, bias)
    if isinstance(encoder, networks.LstmEncoder):
        steps = graph.op("Transpose", _reshaped(graph, window, -1, shape.window, shape.pose), perm=[1, 0, 2])
        last = layers.lstm(graph, steps, encoder.lstm, "encoder.lstm", "last")
        inner = layers.elu(graph, layers.linear(graph, last, encoder.dense, "encoder.dense"))
        return layers.linear(graph, inner, encoder.last, "encoder.last", out)
    raise TypeError(f"No ONNX form is known for the encoder {type(encoder).__name__}.")


def pulls(
    graph: Graph, layers: Layers, network: Coupled, shape: Shape, start: str, goal: str, held: str, gates: str
) -> str:
    """(K, P, Z): what each pass adds to the latents. Coupled.pull node for node, and share_of_pass.

    start, goal (P, T, M, 4), the goal brought as near as the weights say; held (P, M), 0 or 1; gates (K, P).
    """
    axis_last = graph.constant("axis_last", [-1], np.int64)
    windows = graph.op("Concat", start, goal, axis=0)
    both = encode(graph, layers, network, shape, windows, graph.name("latents"))
    latent, pasted = graph.name("latent"), graph.name("pasted")
    graph.ops("Split", [both], [latent, pasted], axis=0, num_outputs=2)
    here, there = (_hands(graph, network.hands, shape, latent, each, held) for each in (start, goal))
    lively = graph.unsqueezed("liveliness", 1)
    less = graph.op("Sub", lively, graph.constant("plus", 1.0))
    calmed = graph.op("Mul", less, graph.constant("calmable", 1 - CALM))
    residual = graph.op("Mul", calmed, graph.op("Sub", latent, here))
    drawn = graph.op("Mul", graph.op("Mul", lively, graph.constant("noise_share", NOISE)), "noise")
    way = graph.op("Sub", there, here)
    body = graph.op("Sub", way, graph.op("Sub", pasted, latent))
    pull = graph.op("Sum", way, graph.op("Mul", body, graph.constant("body_share", BODY)), residual, drawn)
    pull = graph.op("Mul", graph.op("ReduceMax", held, axis_last, keepdims=1), pull)
    numbers = graph.op("Cast", passes(graph), to=TensorProto.FLOAT)
    left = graph.op("Pow", graph.constant("left_by_a_pass", 1 - STEP), numbers)
    shares = graph.unsqueezed(graph.op("Mul", left, graph.constant("step", STEP)), 1)
    return graph.op("Mul", graph.unsqueezed(graph.op("Mul", gates, shares), 2), pull)


def passes(graph: Graph) -> str:
    """(K,): the numbers of the passes of the row that has most."""
    zero, one = graph.constant("zero_int", 0, np.int64), graph.constant("one_int", 1, np.int64)
    most = graph.op("ReduceMax", "coding_iterations", keepdims=0)
    return graph.op("Range", zero, most, one)


def _hands(graph: Graph, hands: HandEncoder, shape: Shape, latent: str, windows: str, held: str) -> str:
    """HandEncoder.forward node for node, in float: it runs once for all passes."""
    column = graph.op("Unsqueeze", windows, graph.constant("axis_last", [-1], np.int64))
    row = graph.op("Unsqueeze", windows, graph.constant("axis_before_last", [-2], np.int64))
    products = _reshaped(graph, graph.op("Mul", column, row), -1, shape.window, shape.joints, 16)
    matrices = graph.op("MatMul", products, graph.constant("matrix", hands.matrix.numpy()))
    matrices = graph.op("Mul", matrices, _reshaped(graph, held, -1, 1, shape.joints, 1))
    steps = _reshaped(graph, matrices, -1, shape.window, shape.joints * 9)
    basis = graph.constant("curves", hands.time.curves.numpy())
    curves = _reshaped(graph, graph.op("MatMul", basis, steps), -1, shape.curves * shape.joints * 9)
    return _mean_latent(graph, hands, graph.op("Concat", latent, curves, held, axis=1), "hands")


def step_to_places(graph: Graph, places: PlaceEncoder, shape: Shape, window: str, gate: str) -> str:
    """(P, Z): Coupled.step_to_places where gate (P) is 1, node for node. In float: its differences are small
    beside the places.
    """
    axis_last = graph.constant("axis_last", [-1], np.int64)
    longest = graph.constant("longest_step", LONGEST_STEP)
    share = graph.op("Mul", "place_weights", graph.op("Mul", graph.unsqueezed(gate, 1), longest))
    share = graph.op("Unsqueeze", share, axis_last)
    placed = graph.op("Greater", "place_weights", graph.constant("zero", 0.0))
    placed = graph.op("Cast", placed, to=TensorProto.FLOAT)
    held = graph.op("Concat", placed, placed, axis=0)
    here = _where(graph, places, shape, window)
    way = graph.op("Sub", "places", here)
    length = graph.op("ReduceL2", way, axis_last, keepdims=1)
    share = graph.op("Div", share, graph.op("Max", length, longest))
    both = graph.op("Concat", graph.op("Add", here, graph.op("Mul", share, way)), here, axis=0)
    apart = graph.op("Sub", both, graph.constant("places.middle", places.middle.numpy()))
    scaled = graph.op("Div", apart, graph.constant("places.spread", places.spread.numpy()))
    scaled = graph.op("Mul", scaled, graph.op("Unsqueeze", held, axis_last))
    seen = graph.op("Concat", _reshaped(graph, scaled, -1, shape.joints * 3), held, axis=1)
    means = _mean_latent(graph, places, seen, "places")
    there, now = graph.name("there"), graph.name("now")
    graph.ops("Split", [means], [there, now], axis=0, num_outputs=2)
    any_placed = graph.op("ReduceMax", placed, axis_last, keepdims=1)
    return graph.op("Mul", graph.op("Sub", there, now), any_placed)


def _mean_latent(graph: Graph, encoder: MeanLatent, seen: str, name: str) -> str:
    """(P, Z): MeanLatent.mean of (P, S), in float."""
    x = EXACT.elu(graph, EXACT.linear(graph, seen, encoder.first, f"{name}.first"))
    more = EXACT.elu(graph, EXACT.linear(graph, x, encoder.second, f"{name}.second"))
    return EXACT.linear(graph, graph.op("Add", x, more), encoder.last, f"{name}.last")


def _where(graph: Graph, places: PlaceEncoder, shape: Shape, window: str) -> str:
    """(P, M, 3): PlaceEncoder.where of windows (P, T, M, 4), with 4 x 4 matrices, joint by joint's depth."""
    bones = places.bones
    joint_first = graph.op("Transpose", window, perm=[2, 0, 1, 3])
    column = graph.op("Unsqueeze", joint_first, graph.constant("axis_last", [-1], np.int64))
    row = graph.op("Unsqueeze", joint_first, graph.constant("axis_before_last", [-2], np.int64))
    products = _reshaped(graph, graph.op("Mul", column, row), shape.joints, -1, 16)
    local = graph.op("MatMul", products, graph.constant("places.bones", _bone_matrices(bones)))
    local = _reshaped(graph, local, shape.joints, -1, 4, 4)
    order: list[int] = []
    worlds: list[str] = []
    for depth, joints in enumerate(bones.levels):
        at = graph.constant(f"joints_at_depth{depth}", joints, np.int64)
        world = graph.op("Gather", local, at, axis=0)
        if worlds:
            above = [bones.levels[depth - 1].index(bones.parents[joint]) for joint in joints]
            parents = graph.constant(f"above_depth{depth}", above, np.int64)
            world = graph.op("MatMul", graph.op("Gather", worlds[-1], parents, axis=0), world)
        worlds.append(world)
        order += joints
    every = _reshaped(graph, graph.op("Concat", *worlds, axis=0), shape.joints, -1, shape.window, 16)
    seen = graph.op("MatMul", graph.constant("shown", places.shown.numpy()), every)
    position = graph.op("Gather", seen, graph.constant("last_column", [3, 7, 11], np.int64), axis=2)
    in_order = graph.constant("depth_order", [order.index(j) for j in range(shape.joints)], np.int64)
    return graph.op("Transpose", graph.op("Gather", position, in_order, axis=0), perm=[1, 0, 2])


def _bone_matrices(bones: Bones) -> np.ndarray:
    """(M, 16, 16): from the products of a joint's unit quaternion to the matrix, row by row, that takes its
    axes to its parent's.
    """
    rotation = matrix_of_products().numpy().astype(np.float64).reshape(16, 3, 3)
    turns = np.einsum("jp,jq->jpq", bones.turns.numpy(), bones.turns.numpy()).reshape(-1, 16)
    one = np.zeros(16)
    one[[0, 5, 10, 15]] = 1.0  # the squares of a unit quaternion
    matrices = np.zeros((len(bones.parents), 16, 4, 4))
    for joint, parent in enumerate(bones.parents):
        turn = np.einsum("p,prc->rc", turns[joint], rotation) if parent >= 0 else np.eye(3)
        matrices[joint, :, :3, :3] = np.einsum("rk,pkc->prc", turn, rotation)
        matrices[joint, :, :3, 3] = np.outer(one, bones.reaches[joint].numpy()) if parent >= 0 else 0.0
        matrices[joint, :, 3, 3] = one
    return matrices.reshape(-1, 16, 16)


def decode(graph: Graph, layers: Layers, network: Network, shape: Shape, latent: str, bias: str = "") -> str:
    """Nodes of the decoder: latents (P, Z) -> raw windows (P, T, M, 4); bias (P, C * M * 4): of its last
    layer.
    """
    decoder = network.decoder
    if isinstance(decoder, networks.MlpDecoder):
        amounts = dense_stack(graph, layers, decoder.stack, latent, "decoder", bias=bias)
        amounts = _reshaped(graph, amounts, -1, shape.curves, shape.pose)
        basis = graph.constant("curves_back", decoder.time.curves.numpy().T)
        flat = graph.op("MatMul", basis, amounts)
    elif isinstance(decoder, networks.LstmDecoder):
        held = layers.elu(graph, layers.linear(graph, latent, decoder.dense, "decoder.dense"))
        steps = layers.lstm_of_repeated(graph, held, decoder.lstm, "decoder.lstm.0", shape.window)
        steps = layers.lstm(graph, steps, decoder.lstm, "decoder.lstm", "steps", first=1)
        steps = graph.op("Transpose", steps, perm=[1, 0, 2])
        rows = _reshaped(graph, steps, -1, shape.width)
        flat = layers.linear(graph, rows, decoder.last, "decoder.last")
    else:
        raise TypeError(f"No ONNX form is known for the decoder {type(decoder).__name__}.")
    return _reshaped(graph, flat, -1, shape.window, shape.joints, 4)


def dense_stack(
    graph: Graph,
    layers: Layers,
    stack: nn.Sequential,
    x: str,
    side: str,
    out: str | None = None,
    bias: str = "",
) -> str:
    """Linear, residual, norm and ELU layers in their order; the sum of a residual goes with the next norm."""
    steps = list(stack)
    skipped = ""  # what must still be added to x
    for place, layer in enumerate(steps):
        name = f"{side}.{place}"
        if isinstance(layer, nn.Linear):
            at_latent = place == (len(steps) - 1 if side == "encoder" else 0)
            kind = EXACT if at_latent or (side == "encoder" and place == 0) else layers
            is_last = place == len(steps) - 1
            given = bias if (is_last if side == "decoder" else place == 0) else ""
            x = kind.linear(graph, x, layer, name, out if is_last else None, given)
        elif isinstance(layer, nn.LayerNorm):
            x, _ = layers.layer_norm(graph, x, layer, name, skipped)
            skipped = ""
        elif isinstance(layer, nn.ELU):
            x = layers.elu(graph, x)
        elif isinstance(layer, networks.Residual):
            normed, summed = layers.layer_norm(graph, x, layer.norm, f"{name}.norm", skipped)
            x = layers.linear(graph, layers.elu(graph, normed), layer.dense, f"{name}.dense")
            skipped = summed
        else:
            raise TypeError(f"No ONNX form is known for {type(layer).__name__}.")
    return x


def _reshaped(graph: Graph, x: str, *sizes: int) -> str:
    name = "shape_" + "x".join(map(str, sizes))
    return graph.op("Reshape", x, graph.constant(name, sizes, np.int64))
