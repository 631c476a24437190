"""The architectures by their names on the command line."""

from __future__ import annotations

from collections.abc import Callable

from appliance.studio.autoencoder.conditional import Conditional
from appliance.studio.autoencoder.networks import Conv, Lstm, LstmAutoregressive, Mlp, Network, Shape

DEFAULT = "conditional"
NETWORKS: dict[str, tuple[Callable[[Shape], Network], dict[str, int]]] = {
    DEFAULT: (Conditional, {"latent": 64, "width": 384, "depth": 1}),
    "mlp": (Mlp, {"latent": 64, "width": 384, "depth": 1}),
    "conv": (Conv, {"latent": 64, "width": 160}),
    "lstm": (Lstm, {"latent": 32, "width": 512}),
    "lstm-autoregressive": (LstmAutoregressive, {"latent": 32, "width": 512}),
    "lstm256": (Lstm, {"latent": 64, "width": 256}),
}


def build(name: str, window: int, joints: int, **sizes: int) -> tuple[Network, Shape]:
    """A network by name; sizes that are not 0 (latent, width, depth) override its own."""
    make, defaults = NETWORKS[name]
    shape = Shape(window, joints, **{**defaults, **{k: v for k, v in sizes.items() if v}})
    return make(shape), shape
