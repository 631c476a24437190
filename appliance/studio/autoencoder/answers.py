"""Lessons in answering: from a window and a hand towards what the dancer does with that joint held so.

A pool of dances that are under way. Each starts on a recorded window; most have hands: one to three joints
with the orientations of another moment, sometimes a frozen one, sometimes one that no dancer ever had. Each
pass asks for a step towards the answer of the repertoire: iterative autoencoding with a purpose, from the
phrase to what this dancer does with that arm, further with each pass. Most passes are led: the dance goes on
from what was asked for. The others go on from what the network made, as it will on stage. A dance without
hands should stay as it is; some are disturbed, and the network should lead them back. Dances come in pairs,
one a few poses after the other: so the network learns how an answer changes from tick to tick.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.autoencoder import slerp_towards
from appliance.studio.autoencoder.lessons import Lesson
from appliance.studio.autoencoder.repertoire import Nearness, Repertoire

_REFILL_PASSES = 16  # dances that have ended begin anew together: the search is a matrix product
_REFILL_ROWS = 512
_HANDS = (0.7, 0.2, 0.1)  # shares of dances with one, two, three hands
_LATER_POSES = 8  # at most, of the second dance of a pair
_DISTURBED_JOINTS = 0.15
_WILD_SPEED = 0.06  # half angles (radians) a pose of hands that no dancer had: about a turn a second


@dataclass(frozen=True)
class AnswerSettings:
    """How answering is taught. Shares are of dances, steps of the way that is left."""

    step: float = 0.6  # of the way to the answer in one pass
    pool: int = 2048
    passes: float = 4.0  # of most dances, at most: a longer one is near its answer, and teaches to copy only
    long: float = 0.1  # dances ten times as long, which show the network where it drifts
    led: float = 0.7  # passes after which a dance goes on from what was asked for, not from what was made
    free: float = 0.4  # dances without a hand
    disturbed: float = 0.25  # of these: some joints are those of another window
    let_go: float = 0.12  # passes of a dance with hands in which nothing is held, as in the last one on stage
    let_go_step: float = 0.1
    light: float = 0.2  # of the dances with hands: weights between 0 and 1
    frozen: float = 0.3  # hands that stand still
    wild: float = 0.15  # hands at orientations that no dancer had
    nearness: Nearness = field(default_factory=Nearness)


class Answers:
    """P dances: first and present window, answer, hands (P, T, M, 4), weights (P, M), age and length."""

    def __init__(self, windows: Tensor, chances: Tensor, settings: AnswerSettings) -> None:
        """windows (N, T, M, 4), heading-free; chances (M,): how often each joint is held."""
        self._settings = settings
        self._recorded, self._chances = windows, chances
        self._repertoire = Repertoire(windows, settings.nearness)
        joints, device = windows.shape[2], windows.device
        self._windows = windows.new_zeros(settings.pool, *windows.shape[1:])
        self._start, self._answer = self._windows.clone(), self._windows.clone()
        self._hands = self._windows.clone()
        self._held = torch.zeros(settings.pool, joints, device=device)
        self._age = torch.zeros(settings.pool, device=device)
        self._passes = torch.zeros(settings.pool, device=device)
        self._drawn = 0

    def draw(self, batch: int) -> Lesson:
        """A random part of the pool, one pass further: first halves of pairs, then their second halves."""
        if self._drawn % _REFILL_PASSES == 0:
            for rows in torch.split((self._age >= self._passes).nonzero()[:, 0], _REFILL_ROWS):
                self._begin(rows)
        self._drawn += 1
        settings = self._settings
        first = 2 * torch.randperm(len(self._age) // 2, device=self._age.device)[: batch // 2]
        rows = torch.cat([first, first + 1])
        windows, answer = self._windows[rows], self._answer[rows]
        is_held = (self._held[rows] > 0).any(dim=1)
        holds = (torch.rand(len(first), device=rows.device) >= settings.let_go).repeat(2)
        held = self._held[rows] * holds[:, None]
        step = torch.where(holds, settings.step, settings.let_go_step)
        step = torch.where(is_held, step, torch.ones_like(step))[:, None, None, None]
        # A held joint is asked for at once: it is not shown where it was.
        share = torch.maximum(step, held[:, None, :, None]).expand_as(answer[..., :1])
        wanted = slerp_towards(windows, answer, share)
        return Lesson(windows, wanted, self._start[rows], self._hands[rows], held, rows)

    def follow(self, lesson: Lesson, made: Tensor) -> None:
        """The dances go on: most from what was asked for, the others from what the network made of them.

        A dance that is led ends on what this dancer does, and the network learns to go there from anywhere on
        the way. On its own windows alone it would learn the mean of all answers, which hardly moves.
        """
        pairs = len(made) // 2
        led = torch.rand(pairs, device=made.device) < self._settings.led
        self._windows[lesson.rows] = torch.where(
            led.repeat(2)[:, None, None, None], lesson.answer, made.detach()
        )
        self._age[lesson.rows] += 1

    def state(self) -> dict[str, Any]:
        return {"drawn": self._drawn, **{name: getattr(self, f"_{name}") for name in _TENSORS}}

    def restore(self, state: dict[str, Any]) -> None:
        self._drawn = state["drawn"]
        for name in _TENSORS:
            getattr(self, f"_{name}").copy_(state[name])

    def _begin(self, rows: Tensor) -> None:
        """New dances in the rows (R,) of the pool, pair by pair."""
        settings, pairs, device = self._settings, len(rows) // 2, rows.device
        later = torch.randint(1, _LATER_POSES + 1, (pairs,), device=device)
        windows = self._moments(pairs, later)
        self._start[rows] = self._windows[rows] = self._answer[rows] = windows
        self._held[rows], self._age[rows] = 0.0, 0.0
        free = torch.rand(pairs, device=device) < settings.free
        longest = torch.where(torch.rand(pairs, device=device) < settings.long, 10.0, 1.0) * settings.passes
        self._passes[rows] = _twice(1 + longest * torch.rand(pairs, device=device))
        disturbed = _twice(free & (torch.rand(pairs, device=device) < settings.disturbed))
        self._windows[rows[disturbed]] = self._disturbed(windows[disturbed])
        if not free.all():
            self._take_hands(rows[~_twice(free)], windows[~_twice(free)], later[~free])

    def _moments(self, pairs: int, later: Tensor) -> Tensor:
        """(2 * pairs, T, M, 4): recorded windows, each followed by the one `later` (pairs,) poses on."""
        first = torch.randint(len(self._recorded), (pairs,), device=later.device)
        second = (first + later).clamp(max=len(self._recorded) - 1)
        return self._recorded[torch.stack([first, second], dim=1).flatten()]

    def _disturbed(self, windows: Tensor) -> Tensor:
        """Windows some of whose joints are on the way to those of another window."""
        pairs, joints, device = len(windows) // 2, windows.shape[2], windows.device
        others = self._moments(pairs, torch.ones(pairs, dtype=torch.long, device=device))
        share = _twice(torch.rand(pairs, 1, 1, 1, device=device))
        taken = _twice(torch.rand(pairs, 1, joints, 1, device=device)) < _DISTURBED_JOINTS
        return slerp_towards(windows, others, (share * taken).expand_as(windows[..., :1]))

    def _take_hands(self, rows: Tensor, windows: Tensor, later: Tensor) -> None:
        """Hands for dances that begin on windows (R, T, M, 4), and the answers to them."""
        settings, pairs, device = self._settings, len(rows) // 2, rows.device
        held = _twice(self._weights(pairs, windows.shape[2], device))
        hands = self._moments(pairs, later)
        wild = torch.rand(pairs, device=device) < settings.wild
        hands[_twice(wild)] = _turning_anywhere(hands[_twice(wild)], later[wild])
        frozen = _twice(torch.rand(pairs, device=device) < settings.frozen)
        hands[frozen] = hands[frozen][:, :1].expand_as(hands[frozen])
        found = self._repertoire.answers(windows, hands, held)
        reach = torch.where(held > 0, held, held.amax(dim=1, keepdim=True))
        reach = reach[:, None, :, None].expand_as(windows[..., :1])
        self._answer[rows] = slerp_towards(windows, found, reach)
        self._hands[rows], self._held[rows] = hands, held

    def _weights(self, count: int, joints: int, device: torch.device) -> Tensor:
        """(count, M): weights of one to three held joints, most of them 1."""
        most = min(len(_HANDS), joints)
        number = torch.multinomial(torch.tensor(_HANDS[:most], device=device), count, replacement=True) + 1
        chosen = torch.multinomial(self._chances.expand(count, -1), most)
        taken = torch.arange(most, device=device) < number[:, None]
        held = torch.zeros(count, joints, device=device).scatter_(1, chosen, taken.float())
        light = torch.rand(count, 1, device=device) < self._settings.light
        return torch.where(light, held * torch.rand(count, joints, device=device), held)


_TENSORS = ("start", "windows", "answer", "hands", "held", "age", "passes")


def _twice(values: Tensor) -> Tensor:
    """Values (pairs, ...) for both dances of each pair."""
    return values.repeat_interleave(2, dim=0)


def _turning_anywhere(windows: Tensor, later: Tensor) -> Tensor:
    """Orientations (R, T, M, 4) anywhere, turning about any axis; the second of a pair `later` poses on."""
    count, poses, joints, _ = windows.shape
    pairs, device = count // 2, windows.device
    start = _twice(rotation.normalize(torch.randn(pairs, 1, joints, 4, device=device)))
    begins = torch.stack([torch.zeros_like(later), later], dim=1).flatten()
    time = (begins[:, None] + torch.arange(poses, device=device) - poses / 2)[:, :, None, None]
    half = _WILD_SPEED * _twice(torch.randn(pairs, 1, joints, 3, device=device)) * time
    turn = torch.cat([torch.ones_like(half[..., :1]), half], dim=-1)
    return rotation.normalize(rotation.multiply(turn, start.expand(-1, poses, -1, -1)))
