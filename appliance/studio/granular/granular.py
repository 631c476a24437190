"""Decoding latents into endless motion, and feeding the network its own motion.

Windows are blended by Hann weights and SLERP. The decoder knows no heading: the dancer faces ahead,
or, between two excerpts, where the first one faces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from appliance.dancer.blending import Blending
from appliance.pose import quaternion
from appliance.studio.evaluation.coders import Poses

if TYPE_CHECKING:
    from appliance.studio.autoencoder.autoencoder import Autoencoder


def once(windows: Poses, hop: int) -> Poses:
    """Windows (W, T, M, 4), `hop` ticks apart, blended: W * hop poses (M, 4)."""
    return _blended(windows, hop, len(windows) * hop)


def cycle(windows: Poses, hop: int) -> Poses:
    """Windows (W, T, M, 4), `hop` ticks apart, as a cycle of W * hop poses.

    It is danced twice and the second time is kept: its first poses are blended with the last windows.
    """
    ticks, length = len(windows) * hop, windows.shape[1]
    return _blended(windows, hop, max(2 * ticks, ticks + length), cyclic=True)[-ticks:]


def fed_back(autoencoder: Autoencoder, phrase: Poses, share: float, passes: int = 1) -> Poses:
    """The network on its own motion, as long as the phrase's windows (W, T, M, 4): poses (W, M, 4).

    Each tick its last window, a tick further on, is coded again, with a share of the phrase's window mixed
    into it by SLERP: 1 is the phrase coded, 0 is left alone with what it danced before.
    """
    import torch

    blending = Blending(phrase.shape[2], phrase.shape[1], shape="hann")
    own, danced = phrase[0], np.empty((len(phrase), *phrase.shape[2:]), dtype=np.float32)
    for tick, given in enumerate(phrase):
        mixed = quaternion.slerp(own, given, np.full(given.shape[:2], share)).astype(np.float32)
        with torch.no_grad():
            made = autoencoder.iterate(torch.from_numpy(mixed[None]), passes)[0].numpy()[0]
        blending.add(made)
        danced[tick] = blending.take()
        own = _a_tick_on(made)
    return danced


def _blended(windows: Poses, hop: int, ticks: int, cyclic: bool = False) -> Poses:
    """`ticks` poses of the windows; cyclic: over and over."""
    count, length, joints, _ = windows.shape
    blending, danced = Blending(joints, length, hop, "hann"), np.empty((ticks, joints, 4), dtype=np.float32)
    for tick in range(ticks):
        number = tick // hop
        if tick % hop == 0 and (cyclic or number < count):
            blending.add(windows[number % count])
        danced[tick] = blending.take()
    return danced


def _a_tick_on(window: Poses) -> Poses:
    """Without its first pose, and with one more that goes on as the last two did."""
    step = quaternion.multiply(window[-1], quaternion.inverse(window[-2]))
    ahead = quaternion.normalize(quaternion.multiply(step, window[-1]))
    further: Poses = np.concatenate([window[1:], ahead[None]]).astype(np.float32)
    return further
