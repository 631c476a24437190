"""A partner as a file of a show: its score of moves and its answers, for `partner` in show.yaml."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import BEFORE
from appliance.dancer.material.partner_network import LED_STEPS, SEEN, PartnerNetwork
from appliance.studio.export.graph import Graph, Layers
from appliance.studio.export.motion_network import Port, checked_model, sizes_of
from appliance.studio.partner.training import EMBEDDING, Answers, Scorer
from appliance.studio.studio_error import StudioError

FILE = "partner.onnx"
_ROUNDING = 0.05  # most that 16-bit weights may change of a score or of a mixture's number


def export_partner(scorer: Scorer, answers: Answers, network: ImproviserNetwork, path: Path) -> None:
    """Write the network's file, weights in 16 bits. Raises StudioError where it is not the trained one."""
    write_partner_network(scorer, answers, network, path)
    generator = torch.Generator().manual_seed(1)
    led, moves = (
        scorer.middle + torch.randn(size, network.features, generator=generator) / scorer.scale
        for size in (LED_STEPS, SEEN)
    )
    with torch.no_grad():
        trained = scorer(led[None], moves[None, None])[0], answers(moves[None, :BEFORE], led[None])
    played = PartnerNetwork(path, network.joints)
    found = (
        played.scores(led.numpy(), moves[None].numpy()),
        played.answers(moves[:BEFORE].numpy(), led.numpy()),
    )
    apart = max(float(np.abs(own.numpy() - other).mean()) for own, other in zip(trained, found, strict=True))
    if not apart <= _ROUNDING:
        path.unlink()
        raise StudioError(
            f"The exported partner differs from the trained one by {apart:.1g}. No file was written. "
            "This is a bug in the export: report it."
        )


def write_partner_network(scorer: Scorer, answers: Answers, network: ImproviserNetwork, path: Path) -> None:
    """led (1, 16, F), moves (N, 11, F) -> scores (N,); before (1, 3, F), led -> mixture."""
    graph, layers, features = Graph(), Layers(int8=False), network.features

    def scaled(value: str, of: Scorer | Answers, name: str, steps: int) -> str:
        middle, scale = (_constant(graph, f"{name}.{one}", getattr(of, one)) for one in ("middle", "scale"))
        level = graph.op("Mul", graph.op("Sub", value, middle), scale)
        return graph.op("Reshape", level, sizes_of(graph, -1, steps * features))

    led = _dense(graph, layers, scorer.of_led, scaled("led", scorer, "scorer", LED_STEPS), "of_led")
    moves = _dense(graph, layers, scorer.of_move, scaled("moves", scorer, "scorer", SEEN), "of_move")
    product = graph.op("MatMul", moves, graph.op("Transpose", led, perm=[1, 0]))
    flat = graph.op("Reshape", product, sizes_of(graph, -1))
    graph.op("Mul", flat, graph.constant("softness", EMBEDDING**-0.5), out="scores")
    seen = graph.op("Concat", "before", "led", axis=1)
    answer = _dense(
        graph, layers, answers.network, scaled(seen, answers, "answers", BEFORE + LED_STEPS), "answers"
    )
    graph.op("Identity", answer, out="mixture")
    numbers = answers.mixtures * (2 * network.code_size + 1)
    ports = (
        [
            Port("led", "l", [LED_STEPS, features]),
            Port("moves", "n", [SEEN, features]),
            Port("before", "b", [BEFORE, features]),
        ],
        [Port("scores", "n", []), Port("mixture", "b", [numbers])],
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


def _dense(graph: Graph, layers: Layers, stack: nn.Sequential, x: str, name: str) -> str:
    for place, layer in enumerate(stack):
        if isinstance(layer, nn.Linear):
            x = layers.linear(graph, x, layer, f"{name}.{place}")
        elif isinstance(layer, nn.ELU):
            x = layers.elu(graph, x)
    return x


def _constant(graph: Graph, name: str, value: Tensor) -> str:
    return graph.constant(name, value.detach().numpy())
