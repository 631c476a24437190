"""A partner as a file of a show: its answers and its scores of moves, for `partner` in show.yaml."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import nn

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.partner_network import LED_STEPS, SEEN, PartnerNetwork
from appliance.studio.export.graph import Graph, Layers
from appliance.studio.export.motion_network import Port, checked_model, sizes_of
from appliance.studio.partner.training import EMBEDDING, Partner, Scale
from appliance.studio.studio_error import StudioError

FILE = "partner.onnx"
_ROUNDING = 0.05  # most that 16-bit weights may change of a score or of a mixture's number


def export_partner(partner: Partner, network: ImproviserNetwork, path: Path) -> None:
    """Write the networks' file, weights in 16 bits. Raises StudioError where it is not what was trained."""
    partner = Partner(*(part.cpu().eval() for part in partner))
    write_partner_network(partner, network, path)
    generator, scale = torch.Generator().manual_seed(1), partner.answers.scale
    led, moves = (
        scale.middle + torch.randn(size, network.features, generator=generator) / scale.scale
        for size in (LED_STEPS, SEEN)
    )
    who, heard = torch.eye(partner.answers.dancers)[:1], torch.ones(1, 1)
    with torch.no_grad():
        trained = (
            partner.scorer(led[None], moves[None, None])[0],
            partner.natural(moves[None], who),
            partner.answers(moves[None], led[None], who, heard),
            partner.answers(moves[None], led[None], who, 0 * heard),
        )
    played = PartnerNetwork(path, network.joints)
    known = moves.numpy(), led.numpy(), who[0].numpy()
    found = (
        played.scores(known[1], known[0][None]),
        played.natural(known[0][None], known[2]),
        played.answers(*known),
        played.answers(known[0], None, known[2]),
    )
    apart = max(float(np.abs(own.numpy() - other).mean()) for own, other in zip(trained, found, strict=True))
    if not apart <= _ROUNDING:
        path.unlink()
        raise StudioError(
            f"The exported partner differs from the trained one by {apart:.1g}. No file was written. "
            "This is a bug in the export: report it."
        )


def write_partner_network(partner: Partner, network: ImproviserNetwork, path: Path) -> None:
    """led (1, 16, F), moves (N, 11, F) -> scores (N,); moves, who (1, W) -> natural (N,); own (1, 11, F),
    led, heard (1, 1), who -> mixture; own -> alike (1, W).
    """
    graph, layers, features = Graph(), Layers(int8=False), network.features
    answers, natural, scorer, alike = partner

    def scaled(value: str, of: Scale, name: str, steps: int) -> str:
        middle, scale = (
            graph.constant(f"{name}.{one}", getattr(of, one).numpy()) for one in ("middle", "scale")
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
    graph.op("Identity", _dense(graph, layers, answers.network, seen, "answers"), out="mixture")
    names = _dense(graph, layers, alike.network, scaled("own", alike.scale, "alike", SEEN), "alike")
    graph.op("Identity", names, out="alike")
    numbers = answers.mixtures * (2 * network.code_size + 1)
    ports = (
        [
            Port("led", "l", [LED_STEPS, features]),
            Port("moves", "n", [SEEN, features]),
            Port("own", "o", [SEEN, features]),
            Port("heard", "h", [1]),
            Port("who", "w", [answers.dancers]),
        ],
        [
            Port("scores", "n", []),
            Port("natural", "n", []),
            Port("mixture", "o", [numbers]),
            Port("alike", "o", [answers.dancers]),
        ],
    )
    facts = {
        "kind": "partner",
        "joints": ",".join(network.joints),
        "window": str(network.window),
        "latent": str(network.latent),
        "rest": str(np.round(network.rest.astype(float), 7).tolist()),
        "mixtures": str(answers.mixtures),
    }
    path.write_bytes(checked_model(graph, ports, facts).SerializeToString())


def _first(graph: Graph) -> list[str]:
    return [graph.constant(f"at_{at}", [at], np.int64) for at in (0, 1)]


def _dense(graph: Graph, layers: Layers, stack: nn.Sequential, x: str, name: str) -> str:
    for place, layer in enumerate(stack):
        if isinstance(layer, nn.Linear):
            x = layers.linear(graph, x, layer, f"{name}.{place}")
        elif isinstance(layer, nn.ELU):
            x = layers.elu(graph, x)
    return x
