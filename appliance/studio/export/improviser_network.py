"""An improviser as a file of a show: its networks and its autoencoder's, for the box's source `improvise`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import BEFORE, FARTHEST, MOVE, improvised
from appliance.pose.whole_file import written_whole
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.export.graph import Graph, Layers
from appliance.studio.export.motion_network import (
    Port,
    checked_model,
    coder_nodes,
    motion_facts,
    require_as_trained,
    sizes_of,
)
from appliance.studio.improviser.improviser import Improviser
from appliance.studio.improviser.moves import Dense

FILE = "improviser.onnx"
_ROUNDING = 0.1  # most that 16-bit weights may change of any number of a step, in its deviations
_CHECKED_MOVES = 4


def export_improviser(
    improviser: Improviser, autoencoder: Autoencoder, joints: Sequence[str], folder: Path
) -> Path:
    """Write the networks' file, weights in 16 bits. Raises StudioError where it is not the trained one."""
    path = folder / FILE
    generator = torch.Generator().manual_seed(1)
    shape = improviser.shape
    inside = 0.5 * torch.randn(2, BEFORE + MOVE, shape.inside, generator=generator)
    heard = improviser.scale.features(inside)
    trained = improviser.improvise(heard, _CHECKED_MOVES, 0.0, 1)
    with written_whole(path) as written:
        write_improviser_network(improviser, autoencoder, joints, written)
        played = improvised(ImproviserNetwork(written, joints), heard.numpy(), _CHECKED_MOVES, 0.0, 1)
        apart = improviser.scale.inside(trained) - improviser.scale.inside(torch.from_numpy(played))
        require_as_trained("improviser", float(apart.abs().mean()), _ROUNDING)
    return path


def write_improviser_network(
    improviser: Improviser, autoencoder: Autoencoder, joints: Sequence[str], path: Path
) -> onnx.ModelProto:
    """windows, latents -> coded, decoded, as in a motion network. steps_heard (B, 3, F), move_heard (B, 8, F)
    -> code_of_move; last_steps, last_code, cells -> mixture, later_cells; steps_before, next_code ->
    next_move: a dancer.material.improvising.Choreographer. Raises StudioError for an autoencoder that is no
    mlp.
    """
    graph, layers, shape = Graph(), Layers(int8=False), improviser.shape
    ports = coder_nodes(graph, layers, autoencoder)
    emitter = _Emitter(graph, layers, improviser)
    for name in ("steps_heard", "move_heard", "steps_before", "last_steps"):
        emitter.inside(name)
    emitter.encode()
    emitter.decode()
    emitter.forecast()
    code, numbers = [shape.code], improviser.choreographer.mixtures * (2 * shape.code + 1)
    cells = [2 * len(improviser.choreographer.cells) * improviser.choreographer.width]
    before, move = [BEFORE, shape.features], [MOVE, shape.features]
    inputs = [
        Port("steps_heard", "h", before),
        Port("move_heard", "h", move),
        Port("steps_before", "b", before),
        Port("next_code", "b", code),
        Port("last_steps", "f", before),
        Port("last_code", "f", code),
        Port("cells", "f", cells),
    ]
    outputs = [
        Port("code_of_move", "h", code),
        Port("next_move", "b", move),
        Port("mixture", "f", [numbers]),
        Port("later_cells", "f", cells),
    ]
    facts = motion_facts(autoencoder, joints) | {
        "kind": "improviser",
        "mixtures": str(improviser.choreographer.mixtures),
    }
    model = checked_model(graph, (ports[0] + inputs, ports[1] + outputs), facts)
    path.write_bytes(model.SerializeToString())
    return model


class _Emitter:
    """The improviser's modules as nodes, each as its forward has it."""

    def __init__(self, graph: Graph, layers: Layers, improviser: Improviser) -> None:
        self._graph, self._layers, self._parts = graph, layers, improviser

    def inside(self, features: str) -> None:
        """Scale.inside, as FEATURES.inside."""
        scale = self._parts.scale
        middled = self._graph.op("Sub", features, self._constant("middle", scale.middle))
        self._graph.op("MatMul", middled, self._constant("inward", scale.inward), out=f"{features}.inside")

    def encode(self) -> None:
        """Moves.encode: only the mean."""
        graph, shape = self._graph, self._parts.shape
        relative = graph.op("Sub", "move_heard.inside", self._last("steps_heard.inside"))
        flat = graph.op("Reshape", relative, sizes_of(graph, -1, MOVE * shape.inside))
        seen = graph.op("Concat", self._flat("steps_heard.inside"), flat, axis=1)
        both = self._dense(self._parts.moves.encoder, seen, "", "moves.encoder")
        first, last = (graph.constant(f"at_{at}", [at], np.int64) for at in (0, shape.code))
        graph.op("Slice", both, first, last, graph.constant("last_axis", [1], np.int64), out="code_of_move")

    def decode(self) -> None:
        """Moves.decode, kept within bounds, as features."""
        graph, scale = self._graph, self._parts.scale
        flat = self._dense(
            self._parts.moves.decoder, self._flat("steps_before.inside"), "next_code", "moves.decoder"
        )
        steps = graph.op("Reshape", flat, sizes_of(graph, -1, MOVE, self._parts.shape.inside))
        made = graph.op("Add", self._last("steps_before.inside"), steps)
        least, most = (graph.constant(f"bound_{bound:g}", bound) for bound in (-FARTHEST, FARTHEST))
        bounded = graph.op("Clip", made, least, most)
        outward = graph.op("MatMul", bounded, self._constant("outward", scale.outward))
        graph.op("Add", outward, self._constant("middle", scale.middle), out="next_move")

    def forecast(self) -> None:
        """Choreographer.numbers."""
        graph, layers, choreographer = self._graph, self._layers, self._parts.choreographer
        seen = graph.op("Concat", self._flat("last_steps.inside"), "last_code", axis=1)
        hidden = layers.elu(graph, layers.linear(graph, seen, choreographer.seen, "seen"))
        width, later = choreographer.width, []
        for level, cell in enumerate(choreographer.cells):
            assert isinstance(cell, nn.LSTMCell)
            h, c = (self._columns("cells", (2 * level + part) * width, width) for part in (0, 1))
            h, c = self._lstm_cell(cell, hidden, h, c, f"cell.{level}")
            later += [h, c]
            hidden = graph.op("Add", hidden, h)
        graph.op("Concat", *later, axis=1, out="later_cells")
        layers.linear(graph, hidden, choreographer.head, "head", "mixture")

    def _lstm_cell(self, cell: nn.LSTMCell, x: str, h: str, c: str, name: str) -> tuple[str, str]:
        """torch's order of gates: input, forget, cell, output."""
        graph = self._graph
        sides = ((x, "seen", cell.weight_ih, cell.bias_ih), (h, "kept", cell.weight_hh, cell.bias_hh))
        sums = [
            graph.op(
                "Gemm",
                value,
                self._constant(f"{name}.{side}", weight.T),
                self._constant(f"{name}.{side}.bias", bias),
            )
            for value, side, weight, bias in sides
        ]
        gates = graph.op("Add", *sums)
        opened = [self._columns(gates, place * cell.hidden_size, cell.hidden_size) for place in range(4)]
        into, forget, out = (graph.op("Sigmoid", opened[place]) for place in (0, 1, 3))
        kept = graph.op("Mul", forget, c)
        later = graph.op("Add", kept, graph.op("Mul", into, graph.op("Tanh", opened[2])))
        return graph.op("Mul", out, graph.op("Tanh", later)), later

    def _dense(self, dense: Dense, x: str, code: str, name: str) -> str:
        """A Dense: each layer sees the code too, if there is one."""
        graph, layers = self._graph, self._layers

        def with_code(value: str) -> str:
            return graph.op("Concat", value, code, axis=1) if code else value

        h = layers.linear(graph, with_code(x), dense.first, f"{name}.first")
        for place, (norm, layer) in enumerate(zip(dense.norms, dense.layers, strict=True)):
            assert isinstance(norm, nn.LayerNorm) and isinstance(layer, nn.Linear)
            normed, _ = layers.layer_norm(graph, h, norm, f"{name}.{place}.norm")
            made = layers.linear(graph, with_code(layers.elu(graph, normed)), layer, f"{name}.{place}")
            h = graph.op("Add", h, made)
        normed, _ = layers.layer_norm(graph, h, dense.last_norm, f"{name}.last_norm")
        return layers.linear(graph, layers.elu(graph, normed), dense.last, f"{name}.last")

    def _flat(self, before: str) -> str:
        """(B, 3, I) -> (B, 3 * I)."""
        return self._graph.op("Reshape", before, sizes_of(self._graph, -1, BEFORE * self._parts.shape.inside))

    def _last(self, before: str) -> str:
        """(B, 3, I) -> (B, 1, I)."""
        at = self._graph.constant("last_step", [BEFORE - 1], np.int64)
        return self._graph.op("Gather", before, at, axis=1)

    def _columns(self, x: str, first: int, count: int) -> str:
        """`count` columns of a matrix."""
        graph = self._graph
        bounds = (graph.constant(f"at_{at}", [at], np.int64) for at in (first, first + count))
        return graph.op("Slice", x, *bounds, graph.constant("last_axis", [1], np.int64))

    def _constant(self, name: str, value: Tensor) -> str:
        return self._graph.constant(f"improviser.{name}", value.detach().numpy())
