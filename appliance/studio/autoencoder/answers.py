"""Lessons in answering: from a window and a hand to what the dancer does with that joint held.

Dances with hands are iterated as on stage: some passes with one to three joints held as they are at another
moment (sometimes frozen, sometimes as no dancer ever held them), then one free pass. The gradient runs back
through all passes: the loss is on what the audience sees in the end, and partly on the first pass. Dances
come in pairs, one a few poses after the other, so that the network learns how an answer changes from tick to
tick.

An answer is something that the dancer did: mirror images, which the network learns to copy, are none.

Windows without a hand should come out unchanged; some are disturbed and led back. Others wander: they are
coded again and again, and are pulled the more towards what the dancer usually does the longer they wander.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.autoencoder import slerp_towards
from appliance.studio.autoencoder.lessons import Hands, Lesson
from appliance.studio.autoencoder.repertoire import Nearness, Repertoire

_HANDS = (0.7, 0.2, 0.1)  # shares of dances with one, two, three hands
_LATER_POSES = 8  # at most, of the second dance of a pair
_DISTURBED_JOINTS = 0.15
_WILD_SPEED = 0.06  # half angles (radians) a pose of hands that no dancer had: about a turn a second
_WEAK_SHARE, _FULL_SHARE = 0.25, 0.45  # of the lessons: with 2 passes, with the most; the others lie between
_SEARCH_EVERY = 16  # lessons between two searches for what the wandering windows are pulled to
_PULL_AGE = 10  # passes until a wandering window is pulled with full strength


@dataclass(frozen=True)
class AnswerSettings:
    """How answering is taught. Shares are of dances; step and pull are shares of the remaining way."""

    step: float = 0.6  # towards the answer in one pass
    passes: int = 10  # at most, the last one without hands
    full_progress: float = 0.4  # of the training, when these are reached: an untrained network would diverge
    reserve: int = 1024  # dances with answers that are searched for together
    uses: int = 2  # of each dance, with different numbers of passes
    light: float = 0.4  # weights between 0 and 1
    frozen: float = 0.3  # hands that stand still
    wild: float = 0.15  # hands at orientations that no dancer had
    with_hands: float = 0.5  # of a batch; the others are without hands
    disturbed: float = 0.25  # of the windows without hands: some joints are those of another window
    wandering: int = 512  # windows that are coded over and over: half of those without hands
    wander: int = 100  # passes at most
    pull: float = 0.2
    nearness: Nearness = field(default_factory=Nearness)


class Answers:
    """Lessons for a conditional network."""

    def __init__(self, windows: Tensor, danced: Tensor, chances: Tensor, settings: AnswerSettings) -> None:
        """windows (N, T, M, 4) to copy, heading-free; danced (D, T, M, 4): those without mirror images, among
        which answers are found; chances (M,): how often each joint is held.
        """
        self._settings = settings
        self._recorded, self._danced, self._chances = windows, danced, chances
        self._repertoire = Repertoire(danced, settings.nearness)
        self._usually = self._repertoire if danced is windows else Repertoire(windows, settings.nearness)
        self._start = windows.new_zeros(settings.reserve, *windows.shape[1:])
        self._answer, self._goal = self._start.clone(), self._start.clone()
        self._held = windows.new_zeros(settings.reserve, windows.shape[2])
        self._order = torch.zeros(settings.uses * settings.reserve // 2, dtype=torch.long)
        self._next = len(self._order)
        self._wandering = self._moments(settings.wandering)
        self._usual = self._wandering.clone()
        self._age = windows.new_zeros(settings.wandering)
        self._drawn = 0

    def draw(self, batch: int, progress: float) -> list[Lesson]:
        """Dances with hands, and windows without: fresh ones, then wandering ones."""
        pairs = max(round(self._settings.with_hands * batch / 2), 1)
        return [self._dances(pairs, progress), self._without_hands(max(batch - 2 * pairs, 2))]

    def follow(self, lesson: Lesson, made: Tensor) -> None:
        """Replace the wandering windows by what the network made of them."""
        if lesson.rows is not None:
            self._wandering[lesson.rows] = made[-len(lesson.rows) :].detach()
            self._age[lesson.rows] += 1

    def state(self) -> dict[str, Any]:
        numbers = {"next": self._next, "drawn": self._drawn}
        return {**numbers, **{name: getattr(self, f"_{name}") for name in _TENSORS}}

    def restore(self, state: dict[str, Any]) -> None:
        self._next, self._drawn = state["next"], state["drawn"]
        for name in _TENSORS:
            getattr(self, f"_{name}").copy_(state[name])

    def _dances(self, pairs: int, progress: float) -> Lesson:
        """First dances of the pairs, then their second ones."""
        if self._next + pairs > len(self._order):
            self._refill()
        first = 2 * self._order[self._next : self._next + pairs].to(self._held.device)
        self._next += pairs
        rows = torch.cat([first, first + 1])
        passes = self._passes(progress)
        start, answer, held = self._start[rows], self._answer[rows], self._held[rows]
        hands = Hands(self._goal[rows], held, self._on_the_way(start, answer, held, 1))
        return Lesson(start, self._on_the_way(start, answer, held, passes - 1), passes, hands)

    def _passes(self, progress: float) -> int:
        """2, the maximum, or any number in between; the maximum grows at the beginning."""
        settings = self._settings
        grown = min(progress / settings.full_progress, 1.0) if settings.full_progress else 1.0
        most = 2 + round((settings.passes - 2) * grown)
        kind = float(torch.rand(()))
        if kind < _WEAK_SHARE:
            return 2
        return most if kind < _WEAK_SHARE + _FULL_SHARE else int(torch.randint(2, most + 1, ()))

    def _on_the_way(self, start: Tensor, answer: Tensor, held: Tensor, passes: int) -> Tensor:
        """Where a dance should be after a number of passes with hands; held joints arrive at once."""
        share = 1 - (1 - self._settings.step) ** passes
        share_of_each = held.clamp_min(share)[:, None, :, None].expand_as(answer[..., :1])
        return slerp_towards(start, answer, share_of_each)

    def _without_hands(self, count: int) -> Lesson:
        fresh, wandering = count - count // 2, min(count // 2, self._settings.wandering)
        if self._drawn % _SEARCH_EVERY == 0:
            self._let_wander()
        self._drawn += 1
        answer = self._moments(fresh)
        windows = self._disturbed(answer)
        rows = torch.randperm(self._settings.wandering)[:wandering].to(answer.device)
        pull = self._settings.pull * (self._age[rows] / _PULL_AGE).clamp(max=1.0)
        lost = self._wandering[rows]
        back = slerp_towards(lost, self._usual[rows], pull[:, None, None, None].expand_as(lost[..., :1]))
        return Lesson(torch.cat([windows, lost]), torch.cat([answer, back]), rows=rows)

    def _let_wander(self) -> None:
        """Windows that have wandered enough begin anew; the others learn where they are pulled to."""
        wander = torch.rand_like(self._age).square() * self._settings.wander
        ended = (self._age > wander + 1).nonzero()[:, 0]
        self._wandering[ended] = self._moments(len(ended))
        self._age[ended] = 0
        self._usual.copy_(self._usually.usual(self._wandering))

    def _refill(self) -> None:
        """New dances, pair by pair, and the answers to their hands."""
        settings, device = self._settings, self._held.device
        pairs = settings.reserve // 2
        later = torch.randint(1, _LATER_POSES + 1, (pairs,), device=device)
        self._start.copy_(self._pairs_of_moments(later))
        self._goal.copy_(self._pairs_of_moments(later))
        wild = torch.rand(pairs, device=device) < settings.wild
        self._goal[_twice(wild)] = _turning_anywhere(self._goal[_twice(wild)], later[wild])
        frozen = _twice(torch.rand(pairs, device=device) < settings.frozen)
        self._goal[frozen] = self._goal[frozen][:, :1].expand_as(self._goal[frozen]).clone()
        self._held.copy_(_twice(self._weights(pairs, self._held.shape[1], device)))
        found = self._repertoire.answers(self._start, self._goal, self._held)
        reach = torch.where(self._held > 0, self._held, self._held.amax(dim=1, keepdim=True))
        reach = reach[:, None, :, None].expand_as(found[..., :1])
        self._answer.copy_(slerp_towards(self._start, found, reach))
        self._order.copy_(torch.cat([torch.randperm(pairs) for _ in range(settings.uses)]))
        self._next = 0

    def _moments(self, count: int) -> Tensor:
        """(count, T, M, 4): recorded windows."""
        return self._recorded[torch.randint(len(self._recorded), (count,), device=self._recorded.device)]

    def _pairs_of_moments(self, later: Tensor) -> Tensor:
        """(2 * pairs, T, M, 4): recorded windows, each followed by that `later` (pairs,) poses on."""
        first = torch.randint(len(self._danced), later.shape, device=later.device)
        second = (first + later).clamp(max=len(self._danced) - 1)
        return self._danced[torch.stack([first, second], dim=1).flatten()]

    def _disturbed(self, windows: Tensor) -> Tensor:
        """The windows; in some, a few joints are moved towards those of another window."""
        count, joints, device = len(windows), windows.shape[2], windows.device
        share = torch.rand(count, 1, 1, 1, device=device)
        taken = torch.rand(count, 1, joints, 1, device=device) < _DISTURBED_JOINTS
        chosen = torch.rand(count, 1, 1, 1, device=device) < self._settings.disturbed
        towards = (share * taken * chosen).expand_as(windows[..., :1])
        return slerp_towards(windows, self._moments(count), towards)

    def _weights(self, count: int, joints: int, device: torch.device) -> Tensor:
        """(count, M): weights of one to three held joints, most of them 1."""
        most = min(len(_HANDS), joints)
        number = torch.multinomial(torch.tensor(_HANDS[:most], device=device), count, replacement=True) + 1
        chosen = torch.multinomial(self._chances.expand(count, -1), most)
        taken = torch.arange(most, device=device) < number[:, None]
        held = torch.zeros(count, joints, device=device).scatter_(1, chosen, taken.float())
        light = torch.rand(count, 1, device=device) < self._settings.light
        return torch.where(light, held * torch.rand(count, joints, device=device), held)


_TENSORS = ("start", "answer", "goal", "held", "order", "wandering", "usual", "age")


def _twice(values: Tensor) -> Tensor:
    """Values (pairs, ...) for both dances of each pair."""
    return values.repeat_interleave(2, dim=0)


def _turning_anywhere(windows: Tensor, later: Tensor) -> Tensor:
    """Random orientations (R, T, M, 4) turning about random axes; the second of a pair `later` poses on."""
    count, poses, joints, _ = windows.shape
    pairs, device = count // 2, windows.device
    start = _twice(rotation.normalize(torch.randn(pairs, 1, joints, 4, device=device)))
    begins = torch.stack([torch.zeros_like(later), later], dim=1).flatten()
    time = (begins[:, None] + torch.arange(poses, device=device) - poses / 2)[:, :, None, None]
    half = _WILD_SPEED * _twice(torch.randn(pairs, 1, joints, 3, device=device)) * time
    turn = torch.cat([torch.ones_like(half[..., :1]), half], dim=-1)
    return rotation.normalize(rotation.multiply(turn, start.expand(-1, poses, -1, -1)))
