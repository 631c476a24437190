"""An exported puppet as the network that was trained, so that a training can go on from a show.

Weights that ship as int8 come back as what the levels stand for: the network computes what the file computes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper
from torch import nn

from appliance.pose.foreign_file import opened
from appliance.studio.autoencoder.architectures import build
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.autoencoder.coupled import Coupled
from appliance.studio.autoencoder.networks import Mlp, Residual
from appliance.studio.autoencoder.rotation import Bones
from appliance.studio.evaluation.coders import TorchCoder
from appliance.studio.model_uses import require_supported
from appliance.studio.studio_error import StudioError

READABLE = ("coupled", "mlp")  # architectures that come back; the others' layers are emitted in parts


def read_exported(path: Path) -> TorchCoder:
    """The network of a puppet's file. Raises StudioError, or OSError."""
    opened(path).close()
    try:
        model = onnx.load(path)
        facts = {entry.key.removeprefix("bunraku."): entry.value for entry in model.metadata_props}
        architecture, joints = facts["architecture"], tuple(facts["joints"].split(","))
        rest = torch.tensor(json.loads(facts["rest"]), dtype=torch.float32)
        constants = {each.name: numpy_helper.to_array(each) for each in model.graph.initializer}
        if architecture in READABLE:
            autoencoder = _rebuilt(architecture, facts, rest, constants)
            known = {"architecture": architecture, "precision": "fp32 in PyTorch"}
            return TorchCoder(autoencoder, joints, {"file": path.name, **known})
    except Exception as error:  # onnx raises another class for each kind of damage
        raise StudioError(
            f"{path} is not a puppet that bunraku exported, or it is damaged. No training can go on from it."
        ) from error
    require_supported(architecture, path)
    raise StudioError(
        f"{path} is a network of the kind '{architecture}'; a training goes on from shows with "
        f"{' and '.join(READABLE)}. Give its checkpoint.pt."
    )


def _rebuilt(
    architecture: str, facts: dict[str, str], rest: torch.Tensor, constants: dict[str, NDArray[Any]]
) -> Autoencoder:
    width, latent = constants["encoder.0.weight"].shape[1], int(facts["latent"])
    depth = sum(name.startswith("encoder.") and name.endswith(".dense.bias") for name in constants)
    network, shape = build(
        architecture, int(facts["window"]), len(rest), latent=latent, width=width, depth=depth
    )
    assert isinstance(network, Mlp)
    for side, stack in (("encoder", network.encoder.stack), ("decoder", network.decoder.stack)):
        _read_stack(stack, side, constants)
    if isinstance(network, Coupled):
        for side in ("hands", "places"):
            for name, layer in getattr(network, side).named_children():
                if isinstance(layer, nn.Linear):
                    _read_layer(layer, f"{side}.{name}", constants)
        parents, *others = json.loads(facts["bones"])
        network.places.set_bones(Bones(parents, *map(torch.tensor, others)))
        _read(network.places.middle, constants["places.middle"])
        _read(network.places.spread, constants["places.spread"])
    return Autoencoder(network, shape, rest).requires_grad_(False).eval()


def _read_stack(stack: nn.Sequential, side: str, constants: dict[str, NDArray[Any]]) -> None:
    """The layers of a dense stack by the names that emit.dense_stack gives their constants."""
    for place, layer in enumerate(stack):
        name = f"{side}.{place}"
        if isinstance(layer, Residual):
            _read_layer(layer.norm, f"{name}.norm", constants)
            _read_layer(layer.dense, f"{name}.dense", constants)
        else:
            _read_layer(layer, name, constants)


def _read_layer(layer: nn.Module, name: str, constants: dict[str, NDArray[Any]]) -> None:
    if isinstance(layer, nn.LayerNorm):
        _read(layer.weight, constants[f"{name}.scale"])
        _read(layer.bias, constants[f"{name}.bias"])
    elif isinstance(layer, nn.Linear):
        _read(layer.weight, _weight(name, constants).T)
        _read(layer.bias, constants[f"{name}.bias"])


def _weight(name: str, constants: dict[str, NDArray[Any]]) -> NDArray[Any]:
    """(in, out), as float or as levels with a scale and a zero point for each column."""
    if f"{name}.weight" in constants:
        return constants[f"{name}.weight"]
    levels, zero = (constants[f"{name}.weight.{part}"].astype(np.float32) for part in ("q", "zero"))
    weight: NDArray[Any] = (levels - zero) * constants[f"{name}.weight.scale"]
    return weight


def _read(parameter: torch.Tensor, values: NDArray[Any]) -> None:
    with torch.no_grad():
        if parameter.shape != values.shape:
            raise ValueError(f"{tuple(values.shape)} where {tuple(parameter.shape)} is expected")
        parameter.copy_(torch.tensor(np.ascontiguousarray(values), dtype=torch.float32))
