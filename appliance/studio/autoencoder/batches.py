"""Batches: the input of a training step and the output that it should give."""

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
class HeldTargets:
    """Held joints of a batch.

    goal (B, T, M, 4): the orientations to reach, hands that hold lightly on the way from the windows'; held
    (B, M): which are held, and how firmly.
    """

    goal: Tensor
    held: Tensor


@dataclass(frozen=True)
class Batch:
    """A batch of heading-free windows (B, T, M, 4) and what should become of them."""

    windows: Tensor
    answer: Tensor
    hands: HeldTargets | None = None


class Batches(Protocol):
    """A source of batches."""

    def draw(self, size: int) -> list[Batch]:
        """The next batches of this process, `batch` windows in all."""

    def state(self) -> dict[str, Any]:
        """The state that later batches depend on besides the random numbers, for `restore`."""

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state."""


class Copies:
    """Batches of the papers' autoencoder: the output should equal the input."""

    def __init__(self, windows: Tensor, noise_degrees: float = 0.0, processes: Processes = ALONE) -> None:
        self._windows, self._noise_degrees, self._processes = windows, noise_degrees, processes

    def draw(self, size: int) -> list[Batch]:
        whole = size * self._processes.count
        rows = torch.randint(len(self._windows), (whole,), device=self._windows.device)
        windows = self._windows[self._processes.share(rows)]
        return [Batch(_shaken(windows, self._noise_degrees), windows)]

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
