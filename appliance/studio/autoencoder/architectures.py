"""The architectures by their names on the command line."""

from __future__ import annotations

from collections.abc import Callable

from appliance.studio.autoencoder.coupled import Coupled
from appliance.studio.autoencoder.dense import Dense
from appliance.studio.autoencoder.networks import Lstm, Mlp, Network, Shape

DEFAULT = "coupled"
NETWORKS: dict[str, tuple[Callable[[Shape], Network], dict[str, int]]] = {
    DEFAULT: (Coupled, {"latent": 64, "width": 384, "depth": 1}),
    "mlp": (Mlp, {"latent": 64, "width": 384, "depth": 1}),
    "lstm": (Lstm, {"latent": 32, "width": 512, "depth": 2}),
    "lstm384": (Lstm, {"latent": 256, "width": 384, "depth": 3}),
    "dense64": (Dense, {"latent": 32, "width": 64, "depth": 2}),
}
MOST_CURVES = 32  # for 128 poses: everything slower than 6 Hz


def build(
    name: str, window: int, joints: int, variational: bool = False, **sizes: int
) -> tuple[Network, Shape]:
    """A network by name; sizes that are not 0 (latent, width, depth) override its own."""
    make, defaults = NETWORKS[name]
    curves = max(1, min(window // 2, MOST_CURVES))
    given = {**defaults, "curves": curves, **{k: v for k, v in sizes.items() if v}}
    shape = Shape(window, joints, variational=variational, **given)
    return make(shape), shape
