"""The quantization gate: int8 ships only if its difference to fp32 cannot be seen."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.data.dataset import WINDOW, Take, window_starts
from appliance.studio.evaluation.coders import Coder, Poses

# Coding and interaction iterations; with a hand, each joint is held in an equal share of the windows.
PASSES = {"1": (1, 0), "10": (10, 0), "10/9": (10, 9)}
LIMITS_DEGREES = {"1": 0.25, "10": 1.5, "10/9": 1.5}  # mean between int8 and fp32 after them
SAMPLE = 256  # windows, evenly spread over the takes


@dataclass(frozen=True)
class Verdict:
    """Mean and largest difference of int8 to fp32 in degrees, by iterations."""

    mean: dict[str, float]
    largest: dict[str, float]

    @property
    def passed(self) -> bool:
        return all(self.mean[k] <= limit for k, limit in LIMITS_DEGREES.items())

    @property
    def precision(self) -> str:
        """The exported result."""
        return "int8" if self.passed else "fp32"

    def sentence(self) -> str:
        """The verdict for people."""
        measured = ", ".join(
            f"{self.mean[k]:.2f} degrees after {k} (at most {limit})" for k, limit in LIMITS_DEGREES.items()
        )
        if self.passed:
            return f"int8 ships: it differs from fp32 by {measured} iterations in the mean."
        return (
            f"fp32 ships: int8 would differ from it by {measured} iterations in the mean. The dance is as "
            "trained, a tick costs more. Train longer, or a wider network, if it has to be faster."
        )


def judge(fp32: Coder, int8: Coder, windows: Poses) -> Verdict:
    """Run both on windows (N, 8, M, 4) and compare."""
    apart = {}
    for k, (coding, interaction) in PASSES.items():
        one, other = (_answers(coder, windows, coding, interaction) for coder in (fp32, int8))
        apart[k] = np.degrees(quaternion.angle_between(one, other))
    return Verdict(
        {k: float(v.mean()) if np.isfinite(v).all() else float("inf") for k, v in apart.items()},
        {k: float(v.max()) for k, v in apart.items()},
    )


def _answers(coder: Coder, windows: Poses, coding: int, interaction: int) -> Poses:
    """Windows (N, 8, M, 4) coded; interactive passes hold one joint of each as in another window."""
    if not interaction:
        return coder.iterate(windows, coding)[0]
    made, joints = np.empty_like(windows), windows.shape[2]
    hands = np.roll(windows, len(windows) // 2, axis=0)
    for joint in range(min(joints, len(windows))):
        rows, mask = slice(joint, None, joints), np.arange(joints) == joint
        hold = HeldJoints(mask, hands[rows], mask.astype(np.float32))
        made[rows] = coder.iterate(windows[rows], coding, interaction, hold)[0]
    return made


def sample_windows(takes: Sequence[Take], places: Sequence[int], count: int = SAMPLE) -> Poses:
    """(N, 8, M, 4): windows of joints at `places`, spread evenly over the takes, `count` at most."""
    starts = [(take, start) for take in takes for start in window_starts(take)]
    chosen = np.linspace(0, len(starts) - 1, min(count, len(starts))).round().astype(int)
    poses: list[NDArray[np.float32]] = []
    for index in chosen:
        take, start = starts[index]
        poses.append(take.recording.poses[start : start + WINDOW, places].astype(np.float32))
    return np.stack(poses) if poses else np.zeros((0, WINDOW, len(places), 4), dtype=np.float32)


def median_ms(coder: Coder, window: Poses, iterations: int = 10, runs: int = 40) -> float:
    """Median cost of coding one window (8, M, 4), in milliseconds."""
    costs = []
    for _ in range(runs + 5):
        began = time.perf_counter()
        coder.iterate(window[None], iterations)
        costs.append(time.perf_counter() - began)
    return 1000.0 * float(np.median(costs[5:]))
