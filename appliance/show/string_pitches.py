"""Which bones have a string, and how high it sounds: for the sound and for the springs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose.skeleton import Skeleton

_SHORTEST = 0.15  # fraction of the longest bone: shorter ones, like fingers, have no string
_MOST = 24  # strings
_LN_1000 = 6.9078  # 60 dB
PENTATONIC = (0, 2, 4, 7, 9)  # semitones: any of them sound together


def string_pitches(
    skeleton: Skeleton, base_hz: float, scale: Sequence[int] = PENTATONIC
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Joints from and to of each string's bone (B, 2), and hertz (B,): inverse to the bone's length, on a
    scale above the base (semitones within an octave)."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    lengths[0] = 0.0
    long = [j for j in np.argsort(-lengths) if lengths[j] > _SHORTEST * lengths.max()][:_MOST]
    joints = sorted(int(joint) for joint in long)
    bones = np.array([(skeleton.parents[joint], joint) for joint in joints], np.intp).reshape(-1, 2)
    if not joints:
        return bones, np.zeros(0)
    above = 12 * np.log2(lengths.max() / lengths[joints])
    notes = (np.array(scale) + 12 * np.arange(5)[:, None]).ravel()
    nearest = notes[np.argmin(np.abs(above[:, None] - notes), axis=1)]
    return bones, np.asarray(base_hz * 2.0 ** (nearest / 12), np.float64)


def decays(frequencies: NDArray[np.float64], lowest: float, decay_s: float) -> NDArray[np.float64]:
    """How fast each frequency dies away, 1/s: the lowest by 60 dB in decay_s, lower ones ring longer."""
    decay: NDArray[np.float64] = _LN_1000 / decay_s * np.sqrt(frequencies / lowest)
    return decay
