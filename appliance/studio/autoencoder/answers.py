"""Batches that teach answering: from a window and a hand to what the dancer does with that joint held.

One to three joints are held as they are at another moment, sometimes frozen, sometimes as no dancer ever held
them. An answer is something that the dancer did: mirror images, which the network learns to copy, are not
searched. Windows without a hand should come out unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.autoencoder import slerp_towards
from appliance.studio.autoencoder.batches import Batch, HeldTargets
from appliance.studio.autoencoder.repertoire import Nearness, Repertoire

_HANDS = (0.75, 0.17, 0.08)  # shares of dances with one, two, three hands
_WILD_SPEED = 0.06  # half angles (radians) a pose of hands that no dancer had: about a turn a second


@dataclass(frozen=True)
class AnswerSettings:
    """How answering is taught. Shares are of dances."""

    reserve: int = 4096  # dances with answers that are searched for together
    uses: int = 4  # poses of each dance
    light: float = 0.2  # weights between 0 and 1
    frozen: float = 0.3  # hands that stand still
    wild: float = 0.1  # hands at orientations that no dancer had
    with_hands: float = 0.4  # fraction of a batch; the others are without hands
    nearness: Nearness = field(default_factory=Nearness)


class Answers:
    """Batches for a coupled network."""

    def __init__(
        self, windows: Tensor, danced: Tensor, takes: Tensor, chances: Tensor, settings: AnswerSettings
    ) -> None:
        """windows (N, T, M, 4) to copy, heading-free; danced (D, T, M, 4): those without mirror images, among
        which answers are found, and their takes (D,); chances (M,): how often each joint is held.
        """
        self._settings = settings
        self._recorded, self._danced, self._takes, self._chances = windows, danced, takes, chances
        self._repertoire = Repertoire(danced, takes, settings.nearness)
        self._start = windows.new_zeros(settings.reserve, *windows.shape[1:])
        self._answer, self._goal = self._start.clone(), self._start.clone()
        self._held = windows.new_zeros(settings.reserve, windows.shape[2])
        self._order = torch.zeros(settings.uses * settings.reserve, dtype=torch.long)
        self._next = len(self._order)

    def draw(self, size: int) -> list[Batch]:
        """Dances with hands, and windows without."""
        count = max(round(self._settings.with_hands * size), 1)
        windows = self._moments(max(size - count, 2))
        return [self._dances(count), Batch(windows, windows)]

    def state(self) -> dict[str, Any]:
        return {"next": self._next, **{name: getattr(self, f"_{name}") for name in _TENSORS}}

    def restore(self, state: dict[str, Any]) -> None:
        self._next = state["next"]
        for name in _TENSORS:
            getattr(self, f"_{name}").copy_(state[name])

    def _dances(self, count: int) -> Batch:
        if self._next + count > len(self._order):
            self._refill()
        rows = self._order[self._next : self._next + count].to(self._held.device)
        self._next += count
        return Batch(self._start[rows], self._answer[rows], HeldTargets(self._goal[rows], self._held[rows]))

    def _refill(self) -> None:
        """New dances and the answers to their hands."""
        settings, device = self._settings, self._held.device
        count = settings.reserve
        first, other = (torch.randint(len(self._danced), (count,), device=device) for _ in range(2))
        self._start.copy_(self._danced[first])
        goal = self._danced[other]
        wild = torch.rand(count, device=device) < settings.wild
        goal[wild] = turning_anywhere(goal[wild])
        frozen = torch.rand(count, device=device) < settings.frozen
        goal[frozen] = goal[frozen][:, :1].expand_as(goal[frozen]).clone()
        self._held.copy_(held_weights(count, self._chances, settings.light))
        share = self._held[:, None, :, None].expand_as(goal[..., :1])
        self._goal.copy_(slerp_towards(self._start, goal, share))
        self._answer.copy_(self._repertoire.answers(self._start, self._goal, self._held, self._takes[first]))
        self._order.copy_(torch.cat([torch.randperm(count) for _ in range(settings.uses)]))
        self._next = 0

    def _moments(self, count: int) -> Tensor:
        """(count, T, M, 4): recorded windows."""
        return self._recorded[torch.randint(len(self._recorded), (count,), device=self._recorded.device)]


_TENSORS = ("start", "answer", "goal", "held", "order")


def held_weights(count: int, chances: Tensor, light_share: float) -> Tensor:
    """(count, M): weights of one to three held joints, most of them 1; chances (M,): of each joint."""
    joints, device = len(chances), chances.device
    most = min(len(_HANDS), joints)
    number = torch.multinomial(torch.tensor(_HANDS[:most], device=device), count, replacement=True) + 1
    chosen = torch.multinomial(chances.expand(count, -1), most)
    taken = torch.arange(most, device=device) < number[:, None]
    held = torch.zeros(count, joints, device=device).scatter_(1, chosen, taken.float())
    light = torch.rand(count, 1, device=device) < light_share
    return torch.where(light, held * torch.rand(count, joints, device=device), held)


def turning_anywhere(windows: Tensor) -> Tensor:
    """Random orientations (R, T, M, 4) turning about random axes, in place of windows."""
    count, poses, joints, _ = windows.shape
    device = windows.device
    start = rotation.normalize(torch.randn(count, 1, joints, 4, device=device))
    time = (torch.arange(poses, device=device) - poses / 2)[None, :, None, None]
    half = _WILD_SPEED * torch.randn(count, 1, joints, 3, device=device) * time
    turn = torch.cat([torch.ones_like(half[..., :1]), half], dim=-1)
    return rotation.normalize(rotation.multiply(turn, start.expand(-1, poses, -1, -1)))
