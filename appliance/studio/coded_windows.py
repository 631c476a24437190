"""Windows as latents and back: by a checkpoint's autoencoder in torch, or a show's network without it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from appliance.dancer.material.latent_paths import Latents
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.studio.evaluation.coders import Poses

if TYPE_CHECKING:
    from appliance.studio.autoencoder.autoencoder import Autoencoder

    Network = Autoencoder | MotionNetwork


def window_of(network: Network) -> int:
    """Poses of a window."""
    return network.window if isinstance(network, MotionNetwork) else network.shape.window


def latent_of(network: Network) -> int:
    """Numbers of a latent."""
    return network.latent if isinstance(network, MotionNetwork) else network.shape.latent


def decoded(network: Network, path: Latents, facing: Array | None = None, is_raw: bool = False) -> Poses:
    """Latents (W, Z) -> windows (W, T, M, 4); facing: (W, 4), left out: ahead.

    is_raw: quaternions as the network gives them, the longer the more certain it is.
    """
    if isinstance(network, MotionNetwork):
        made: Poses = network.decode(path)
        if not is_raw:
            made = quaternion.normalize(made).astype(np.float32)
    else:
        import torch

        with torch.no_grad():
            decode = network.decode_raw if is_raw else network.decode
            made = decode(torch.from_numpy(path)).numpy()
    if facing is not None:
        made[:, :, 0] = quaternion.multiply(facing.astype(np.float32)[:, None], made[:, :, 0])
    return made


def encoded(network: Network, windows: Poses) -> tuple[Latents, Array]:
    """Windows (W, T, M, 4) -> latents (W, Z), and where each of them faces (W, 4)."""
    if isinstance(network, MotionNetwork):
        return network.encode(windows)
    import torch

    with torch.no_grad():
        given = torch.from_numpy(windows)
        facing = network.facing(given)
        latents: Latents = network.encode(network.without_heading(given, facing)).numpy()
    return latents, facing.numpy()
