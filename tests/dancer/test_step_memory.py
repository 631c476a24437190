"""Step memory: the steps are the same whenever they are read, and reading them rarely costs few runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from appliance.dancer.material.steps import HOP, ROOT, WINDOW
from appliance.dancer.step_memory import CAPACITY, WAITING, StepMemory
from appliance.pose import quaternion

JOINTS, LATENT, TICKS = 3, 5, 300


class Coder:
    """Latents that every pose of a window changes; counts its runs."""

    latent = LATENT

    def __init__(self) -> None:
        self.runs = 0
        self._weights = np.random.default_rng(5).normal(size=(WINDOW * JOINTS * 4, LATENT))

    def encode(self, windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.runs += 1
        found = np.stack([window.reshape(-1).astype(float) @ self._weights for window in windows])
        return found.astype(np.float32), windows[:, WINDOW // 2, 0]


def dance() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(2)
    poses = quaternion.normalize(random.normal(size=(TICKS, JOINTS, 4))).astype(np.float32)
    return poses, random.normal(size=(TICKS, 3)).astype(np.float32)


def watched(phase: int, reads: range, count: int = 16) -> tuple[list[Any], int]:
    """What reading at these ticks gives, and the encoder's runs."""
    coder = Coder()
    memory = StepMemory(coder, list(range(JOINTS)), phase)  # type: ignore[arg-type]
    found = []
    for tick, (pose, root) in enumerate(zip(*dance(), strict=True)):
        memory.watch(pose, root)
        if tick in reads:
            recent = memory.recent(count)
            found.append((tick, None if recent is None else recent.copy()))
    return found, coder.runs


@pytest.mark.parametrize("phase", range(HOP))
def test_steps_are_the_same_however_rarely_they_are_read(phase: int) -> None:
    often, runs = watched(phase, range(TICKS))
    at_last, few = watched(phase, range(TICKS - 1, TICKS), CAPACITY - 1)
    now_and_then, _ = watched(phase, range(0, TICKS, 16))
    steps = dict(often)
    assert steps[TICKS - 1] is not None and any(read is not None for _, read in now_and_then)
    for tick, read in now_and_then:
        np.testing.assert_array_equal(read, steps[tick])
    np.testing.assert_array_equal(at_last[0][1][-16:], steps[TICKS - 1])
    assert few <= TICKS / HOP / WAITING + 1 < runs / 5


def test_each_step_is_the_window_that_ended_then() -> None:
    """Against windows cut out of the dance by hand."""
    poses, roots = dance()
    (_, steps), *_ = watched(0, range(TICKS - 1, TICKS))[0]
    for back in range(16):
        end = TICKS - HOP * back
        latent = Coder().encode(poses[None, end - WINDOW : end])[0][0]
        np.testing.assert_array_equal(steps[-1 - back, :-ROOT], latent)
        assert steps[-1 - back, -1] == roots[end - WINDOW // 2, 1]
