"""Lessons: the input of a training step and the output that it should give."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.processes import Processes
from appliance.studio.training_loop import ALONE


@dataclass(frozen=True)
class Hands:
    """Joints held in all passes of a lesson but the last, as on stage.

    goal (B, T, M, 4): their orientations; held (B, M): how firmly; first (B, T, M, 4): the windows that the
    first pass should give. The second half of the batch has the same dances a few poses later.
    """

    goal: Tensor
    held: Tensor
    first: Tensor


@dataclass(frozen=True)
class Lesson:
    """A batch of heading-free windows (B, T, M, 4) and what should come out after a number of passes.

    rows: places of its wandering windows in their pool.
    """

    windows: Tensor
    answer: Tensor
    passes: int = 1
    hands: Hands | None = None
    rows: Tensor | None = None


class Lessons(Protocol):
    """A source of lessons that sees the network's results."""

    def draw(self, batch: int, progress: float) -> list[Lesson]:
        """The next lessons of this process, `batch` windows in all, at a progress of 0 to 1 through the
        training.
        """

    def follow(self, lesson: Lesson, made: Tensor) -> None:
        """Receive the windows that the network made of a lesson."""

    def state(self) -> dict[str, Any]:
        """What later lessons depend on besides the random numbers, for `restore`."""

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state."""


class Copies:
    """Lessons of the papers' autoencoder: the output should equal the input."""

    def __init__(self, windows: Tensor, noise_degrees: float = 0.0, processes: Processes = ALONE) -> None:
        self._windows, self._noise_degrees, self._processes = windows, noise_degrees, processes

    def draw(self, batch: int, progress: float) -> list[Lesson]:
        whole = batch * self._processes.count
        rows = torch.randint(len(self._windows), (whole,), device=self._windows.device)
        windows = self._windows[self._processes.share(rows)]
        return [Lesson(_shaken(windows, self._noise_degrees), windows)]

    def follow(self, lesson: Lesson, made: Tensor) -> None:
        return

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        return


def _shaken(windows: Tensor, degrees: float) -> Tensor:
    """The windows, each joint turned by one small random rotation per window."""
    if degrees <= 0:
        return windows
    half = (
        math.radians(degrees) / 2 * torch.randn(len(windows), 1, windows.shape[2], 3, device=windows.device)
    )
    turn = torch.cat([torch.ones_like(half[..., :1]), half], dim=-1)
    return rotation.normalize(rotation.multiply(windows, turn.expand(-1, windows.shape[1], -1, -1)))
