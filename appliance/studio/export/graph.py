"""ONNX nodes by hand: a small builder, and what each torch layer becomes in float or dynamic int8.

Written by hand because the iteration lives or dies by its node count (at batch 1 a node costs about as much
as its arithmetic), and because the stock tools cannot quantize what stands inside a Loop.

int8 means: weights u8 per output channel with zero point 128 (full-range s8 saturates on AVX2 without VNNI),
activations quantized per call by onnxruntime's DynamicQuantize* operators.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import nn

MICROSOFT = "com.microsoft"
OPSET = 18


class Graph:
    """Nodes and constants in the order in which they are said."""

    def __init__(self, prefix: str = "", constants: dict[str, NDArray[Any]] | None = None) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: dict[str, NDArray[Any]] = {} if constants is None else constants
        self._prefix, self._count = prefix, 0

    def name(self, kind: str) -> str:
        self._count += 1
        return f"{self._prefix}{kind}_{self._count}"

    def op(self, kind: str, *inputs: str, out: str | None = None, domain: str = "", **attributes: Any) -> str:
        """Add a node with one output; its name is returned."""
        out = out or self.name(kind)
        self.nodes.append(helper.make_node(kind, list(inputs), [out], domain=domain, **attributes))
        return out

    def ops(
        self, kind: str, inputs: list[str], outputs: list[str], domain: str = "", **attributes: Any
    ) -> None:
        """Add a node with any number of outputs ('' leaves one out)."""
        self.nodes.append(helper.make_node(kind, inputs, outputs, domain=domain, **attributes))

    def unsqueezed(self, x: str, *axes: int) -> str:
        """x with new axes of size 1 at these places."""
        name = "axes_" + "_".join(map(str, axes))
        return self.op("Unsqueeze", x, self.constant(name, axes, np.int64))

    def constant(self, name: str, value: Any, dtype: Any = np.float32) -> str:
        """A constant tensor; the same name is stored once and shared with every graph around."""
        if name not in self.constants:
            self.constants[name] = np.asarray(value, dtype=dtype)
        return name

    def initializers(self) -> list[onnx.TensorProto]:
        return [numpy_helper.from_array(np.array(v, order="C"), k) for k, v in self.constants.items()]


class Layers:
    """Emits torch layers into a graph; `int8` chooses quantized ones where onnxruntime has them."""

    def __init__(self, int8: bool) -> None:
        self.int8 = int8

    def linear(
        self, graph: Graph, x: str, layer: nn.Linear, name: str, out: str | None = None, bias: str = ""
    ) -> str:
        """(B, in) -> (B, out); bias: a node of shape (B, out) in place of the layer's own."""
        weight = _array(layer.weight).T
        added = bias or graph.constant(f"{name}.bias", _array(layer.bias))
        if not self.int8:
            return graph.op("Gemm", x, graph.constant(f"{name}.weight", weight), added, out=out)
        quantized = _quantized(graph, f"{name}.weight", weight)
        if bias:  # the quantized product takes one bias for all rows
            product = graph.op("DynamicQuantizeMatMul", x, *quantized, domain=MICROSOFT)
            return graph.op("Add", product, bias, out=out)
        return graph.op("DynamicQuantizeMatMul", x, *quantized, added, out=out, domain=MICROSOFT)

    def layer_norm(
        self, graph: Graph, x: str, layer: nn.LayerNorm, name: str, skipped: str = ""
    ) -> tuple[str, str]:
        """Norm of x, or of x + skipped in one node: (norm, what was normed)."""
        scale = graph.constant(f"{name}.scale", _array(layer.weight))
        bias = graph.constant(f"{name}.bias", _array(layer.bias))
        if not skipped:
            return graph.op("LayerNormalization", x, scale, bias, axis=-1, epsilon=layer.eps), x
        normed, summed = graph.name("normed"), graph.name("summed")
        inputs, outputs = [x, skipped, scale, bias], [normed, "", "", summed]
        graph.ops("SkipLayerNormalization", inputs, outputs, MICROSOFT, epsilon=layer.eps)
        return normed, summed

    def elu(self, graph: Graph, x: str) -> str:
        return graph.op("Elu", x, alpha=1.0)

    def lstm(self, graph: Graph, x: str, layer: nn.LSTM, name: str, keep: str, first: int = 0) -> str:
        """(T, P, in) -> all steps (T, P, H) for keep='steps', the last (P, H) for keep='last'."""
        for level in range(first, layer.num_layers):
            last = keep == "last" and level == layer.num_layers - 1
            kind = "last" if last else "steps"
            out = self.lstm_node(graph, x, _level(layer, level), f"{name}.{level}", kind)
            axis = graph.constant("axis0" if last else "axis1", [0 if last else 1], np.int64)
            x = graph.op("Squeeze", out, axis)
        return x

    def lstm_node(
        self,
        graph: Graph,
        x: str,
        weights: tuple[NDArray[Any], NDArray[Any], NDArray[Any]],
        name: str,
        keep: str,
    ) -> str:
        """One LSTM layer as one node; keep: which is wanted, all 'steps' or the 'last'."""
        w, r, b = weights
        out = graph.name(keep)
        outputs = [out] if keep == "steps" else ["", out]
        bias, size = graph.constant(f"{name}.bias", b), r.shape[-1]
        if self.int8:
            wq, ws, wz = _quantized(graph, f"{name}.w", w[0].T, lead=True)
            rq, rs, rz = _quantized(graph, f"{name}.r", r[0].T, lead=True)
            inputs = [x, wq, rq, bias, "", "", "", "", ws, wz, rs, rz]
            graph.ops("DynamicQuantizeLSTM", inputs, outputs, MICROSOFT, hidden_size=size)
        else:
            w_name, r_name = graph.constant(f"{name}.w", w), graph.constant(f"{name}.r", r)
            graph.ops("LSTM", [x, w_name, r_name, bias], outputs, hidden_size=size)
        return out

    def lstm_of_repeated(self, graph: Graph, x: str, layer: nn.LSTM, name: str, steps: int) -> str:
        """First level of an LSTM whose inputs (P, in) are the same at each step: (steps, P, H)."""
        sizes = graph.constant(f"repeated{steps}", [steps, 1, 1], np.int64)
        repeated = graph.op("Expand", graph.unsqueezed(x, 0), sizes)
        out = self.lstm_node(graph, repeated, _level(layer, 0), name, "steps")
        return graph.op("Squeeze", out, graph.constant("axis1", [1], np.int64))


def _level(layer: nn.LSTM, level: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    kinds = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
    return lstm_weights(*(getattr(layer, f"{kind}_l{level}") for kind in kinds))


def lstm_weights(
    weight_ih: torch.Tensor, weight_hh: torch.Tensor, bias_ih: torch.Tensor, bias_hh: torch.Tensor
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """torch's gate order i, f, g, o to ONNX's i, o, f, c; shapes (1, 4H, in), (1, 4H, H), (1, 8H)."""

    def ordered(w: torch.Tensor) -> NDArray[Any]:
        i, f, g, o = np.split(_array(w), 4, axis=0)
        return np.concatenate([i, o, f, g], axis=0)

    bias = np.concatenate([ordered(bias_ih), ordered(bias_hh)])
    return ordered(weight_ih)[None], ordered(weight_hh)[None], bias[None]


def info(
    name: str, shape: Sequence[int | str | None] | None, kind: int = TensorProto.FLOAT
) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, kind, shape)


def _array(tensor: torch.Tensor) -> NDArray[np.float32]:
    return tensor.detach().cpu().numpy().astype(np.float32)


def _quantized(graph: Graph, name: str, weight: NDArray[Any], lead: bool = False) -> tuple[str, str, str]:
    """(in, out) float -> names of u8 weights, scales, zero points per output channel; lead adds an axis."""
    reach = np.abs(weight).max(axis=0)
    scale = np.where(reach > 0, reach / 127, 1.0).astype(np.float32)
    levels = (np.clip(np.rint(weight / scale), -127, 127) + 128).astype(np.uint8)
    zero = np.full(scale.shape, 128, dtype=np.uint8)
    if lead:
        levels, scale, zero = levels[None], scale[None], zero[None]
    return (
        graph.constant(f"{name}.q", levels, np.uint8),
        graph.constant(f"{name}.scale", scale),
        graph.constant(f"{name}.zero", zero, np.uint8),
    )
