"""A partner as a file of a show: its answers and its scores of moves, for `partner` in show.yaml."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper
from torch import nn

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.partner_network import LED_STEPS, SEEN, PartnerNetwork
from appliance.pose.whole_file import written_whole
from appliance.studio.export.graph import Graph, Layers
from appliance.studio.export.motion_network import Port, checked_model, require_as_trained, sizes_of
from appliance.studio.partner.training import EMBEDDING, FLOW_STEPS, Answers, Partner, Scale, times_of

FILE = "partner.onnx"
_ROUNDING = 0.1  # most that 8-bit weights may change of a score or of a code's number


def export_partner(partner: Partner, network: ImproviserNetwork, path: Path) -> None:
    """Write the networks' file, weights in 8 bits. Raises StudioError where it is not what was trained."""
    for part in partner:
        part.cpu().eval()
    generator, scale = torch.Generator().manual_seed(1), partner.answers.scale
    led, moves = (
        scale.middle + torch.randn(size, network.features, generator=generator) / scale.scale
        for size in (LED_STEPS, SEEN)
    )
    who, heard = torch.eye(partner.answers.dancers)[:1], torch.ones(1, 1)
    noise = torch.randn(5, network.code_size, generator=generator)
    with torch.no_grad():
        trained = (
            partner.scorer(led[None], moves[None, None])[0],
            partner.natural(moves[None], who),
            partner.answers(moves[None], led[None], who, heard, noise),
            partner.answers(moves[None], led[None], who, 0 * heard, noise),
        )
    known = moves.numpy(), led.numpy(), who[0].numpy()
    with written_whole(path) as written:
        write_partner_network(partner, network, written)
        played = PartnerNetwork(written, network.joints)
        found = (
            played.scores(known[1], known[0][None]),
            played.natural(known[0][None], known[2]),
            played.answers(*known, noise.numpy()),
            played.answers(known[0], None, known[2], noise.numpy()),
        )
        apart = (float(np.abs(own.numpy() - other).mean()) for own, other in zip(trained, found, strict=True))
        require_as_trained("partner", max(apart), _ROUNDING)


def write_partner_network(partner: Partner, network: ImproviserNetwork, path: Path) -> None:
    """led (1, 16, F), moves (N, 11, F) -> scores (N,); moves, who (1, W) -> natural (N,); own (1, 11, F),
    led, heard (1, 1), who, noise (N, C) -> codes (N, C); own -> alike (1, W).
    """
    graph, layers, features = Graph(), Layers(int8=False), network.features
    answers, natural, scorer, alike = partner

    def scaled(value: str, of: Scale, name: str, steps: int) -> str:
        middle, scale = (
            graph.constant(f"{name}.{one}", of.get_buffer(one).numpy()) for one in ("middle", "scale")
        )
        level = graph.op("Mul", graph.op("Sub", value, middle), scale)
        return graph.op("Reshape", level, sizes_of(graph, -1, steps * features))

    led = _dense(graph, layers, scorer.of_led, scaled("led", scorer.scale, "scorer", LED_STEPS), "of_led")
    moves = _dense(graph, layers, scorer.of_move, scaled("moves", scorer.scale, "scorer", SEEN), "of_move")
    product = graph.op("MatMul", moves, graph.op("Transpose", led, perm=[1, 0]))
    flat = graph.op("Reshape", product, sizes_of(graph, -1))
    graph.op("Mul", flat, graph.constant("softness", EMBEDDING**-0.5), out="scores")
    seen = scaled("moves", natural.scale, "natural", SEEN)
    rows = graph.op("Slice", graph.op("Shape", seen), *_first(graph))
    sizes = graph.op("Concat", rows, graph.constant("who_size", [answers.dancers], np.int64), axis=0)
    seen = graph.op("Concat", seen, graph.op("Expand", "who", sizes), axis=1)
    likelier = _dense(graph, layers, natural.network, seen, "natural")
    graph.op("Reshape", likelier, sizes_of(graph, -1), out="natural")
    own, other = (
        scaled(name, answers.scale, "answers", steps) for name, steps in (("own", SEEN), ("led", LED_STEPS))
    )
    seen = graph.op("Concat", own, graph.op("Mul", other, "heard"), "who", "heard", axis=1)
    _flow(graph, layers, answers, _dense(graph, layers, answers.context, seen, "answers"))
    names = _dense(graph, layers, alike.network, scaled("own", alike.scale, "alike", SEEN), "alike")
    graph.op("Identity", names, out="alike")
    ports = (
        [
            Port("led", "l", [LED_STEPS, features]),
            Port("moves", "n", [SEEN, features]),
            Port("own", "o", [SEEN, features]),
            Port("heard", "h", [1]),
            Port("who", "w", [answers.dancers]),
            Port("noise", "c", [answers.code]),
        ],
        [
            Port("scores", "n", []),
            Port("natural", "n", []),
            Port("codes", "c", [answers.code]),
            Port("alike", "o", [answers.dancers]),
        ],
    )
    facts = {
        "kind": "partner",
        "joints": ",".join(network.joints),
        "window": str(network.window),
        "latent": str(network.latent),
        "rest": str(np.round(network.rest.astype(float), 7).tolist()),
    }
    path.write_bytes(in_eight_bits(checked_model(graph, ports, facts)).SerializeToString())


def in_eight_bits(model: onnx.ModelProto) -> onnx.ModelProto:
    """The same model, each large matrix stored in 8 bits with a scale a column; widened when loaded."""
    stored = {one.name: one for one in model.graph.initializer}
    widened = {node.input[0]: node for node in model.graph.node if node.op_type == "Cast"}
    nodes = []
    for name, node in widened.items():
        weight = numpy_helper.to_array(stored[name]).astype(np.float32) if name in stored else np.zeros(0)
        if weight.ndim != 2:
            continue
        scale = np.maximum(np.abs(weight).max(axis=0, keepdims=True), 1e-9) / np.float32(127)
        small, out = np.round(weight / scale).astype(np.int8), node.output[0]
        stored[name].CopyFrom(numpy_helper.from_array(small, name))
        model.graph.initializer.append(numpy_helper.from_array(scale, f"{out}.scale"))
        node.output[0] = f"{out}.wide"
        nodes.append(helper.make_node("Mul", [f"{out}.wide", f"{out}.scale"], [out]))
    rest = list(model.graph.node)
    casts = [node for node in rest if node.op_type == "Cast"]
    others = [node for node in rest if node.op_type != "Cast"]
    del model.graph.node[:]
    model.graph.node.extend([*casts, *nodes, *others])
    onnx.checker.check_model(model)
    return model


def _flow(graph: Graph, layers: Layers, answers: Answers, context: str) -> None:
    """Answers.forward after its context, as codes."""
    seen, codes = layers.elu(graph, context), "noise"
    conditioned = [
        layers.linear(graph, seen, layer, f"condition.{n}")
        for n, layer in enumerate(answers.conditions)
        if isinstance(layer, nn.Linear)
    ]
    for number in range(FLOW_STEPS):
        times, hidden = times_of(torch.full((1, 1), number / FLOW_STEPS)), codes
        for n, (step, when) in enumerate(zip(answers.steps, answers.when, strict=True)):
            weight = graph.constant(f"flow.{n}", step.get_parameter("weight").detach().numpy().T)
            moved = graph.op("Add", graph.op("MatMul", hidden, weight), conditioned[n])
            shift = graph.constant(f"when.{n}.{number}", when(times).detach().numpy())
            hidden = layers.elu(graph, graph.op("Add", moved, shift))
        way = layers.linear(graph, hidden, answers.last, "last")
        way = graph.op("Mul", way, graph.constant("pace", 1 / FLOW_STEPS))
        codes = graph.op("Add", codes, way, out="codes" if number == FLOW_STEPS - 1 else None)


def _first(graph: Graph) -> list[str]:
    return [graph.constant(f"at_{at}", [at], np.int64) for at in (0, 1)]


def _dense(graph: Graph, layers: Layers, stack: nn.Sequential, x: str, name: str) -> str:
    for place, layer in enumerate(stack):
        if isinstance(layer, nn.Linear):
            x = layers.linear(graph, x, layer, f"{name}.{place}")
        elif isinstance(layer, nn.ELU):
            x = layers.elu(graph, x)
    return x
