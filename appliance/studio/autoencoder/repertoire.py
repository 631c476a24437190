"""The repertoire: the recorded windows, searched for what the dancer does while joints are held.

The dancer's usual movement near a window is the mean of all recorded windows, each weighted by its nearness
(a kernel regression, Nadaraya and Watson 1964); with a hand, nearness includes how the joint is held. A
single nearest window would jump between takes from tick to tick.

The answer to a hand is a difference: what is usual with the hand, less what is usual with the joints as the
window has them, added to the window itself. Both means are equally smooth, so nothing of the dance's spread
is lost between them. The mean with the hand, which earlier releases taught, is calmer than any dance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.autoencoder import slerp_towards

_SEARCH_ROWS = 256  # at a time: each search is a matrix product
_BELIEVED_RADIANS = 1.5  # a hand this far from everything that the dancer does has weight e^-1
_FAR = 1e9


@dataclass(frozen=True)
class Nearness:
    """Defines nearness of a recorded window.

    The distance is the sum of: squared chords (half the angle) of the free joints, and of their change over
    the window times `change`, over `bandwidth`; for each held joint its squared angle to the hand in units of
    `hand_degrees`, halved, and the squared chord between their changes times `hand_change`.
    """

    searched: int = 6_000  # windows at most, evenly spaced: always the same ones, for one answer
    change: float = 1.5
    bandwidth: float = 0.35  # smaller: nearer to single recorded windows, and rougher
    hand_degrees: float = 12.0
    hand_change: float = 2.0
    steps: int = 2  # differences, one after the other: the second finds what the first missed


class Repertoire:
    """Heading-free windows (N, T, M, 4), thinned out, with the features that are searched."""

    def __init__(self, windows: Tensor, takes: Tensor, nearness: Nearness) -> None:
        """takes (N,): the number of each window's take."""
        self._nearness = nearness
        every = max(math.ceil(len(windows) / nearness.searched), 1)
        self._windows, self._takes = windows[::every].contiguous(), takes[::every].contiguous()
        self._middle, self._change = middle(self._windows), change(self._windows)
        self._features = _features(self._middle, self._change, nearness.change)

    def answers(self, windows: Tensor, hands: Tensor, held: Tensor, takes: Tensor) -> Tensor:
        """The windows when hands, both (L, T, M, 4), hold the joints where held (L, M) is not 0.

        takes (L,): the windows' own takes, which are not searched: on stage the dancer's phrase is new.
        """
        rows = (torch.split(all_rows, _SEARCH_ROWS) for all_rows in (windows, hands, held, takes))
        return torch.cat([self._answer(*row) for row in zip(*rows, strict=True)])

    def _answer(self, windows: Tensor, hands: Tensor, held: Tensor, takes: Tensor) -> Tensor:
        answer = windows
        for _ in range(self._nearness.steps):
            free = self._distance_of_the_free(answer, held) / self._nearness.bandwidth
            there = self._mean(free, hands, held, takes)
            here = self._mean(free, answer, held, takes)
            own = rotation.multiply(rotation.inverse(here), answer)
            answer = rotation.normalize(rotation.multiply(there, own))
        is_held = (held > 0).to(answer.dtype)[:, None, :, None].expand_as(answer[..., :1])
        return slerp_towards(answer, hands, is_held)

    def _mean(self, free: Tensor, hands: Tensor, held: Tensor, takes: Tensor) -> Tensor:
        """(L, T, M, 4): mean of the recorded windows near by `free` (L, N), with joints held as in hands."""
        cost = free.clone()
        self._add_distance_of_the_held(cost, hands, held)
        cost.masked_fill_(takes[:, None] == self._takes, _FAR)
        share = torch.softmax(cost.amin(dim=1, keepdim=True) - cost, dim=-1)
        mean = share @ self._windows.flatten(1)
        return rotation.normalize(mean.view(-1, *self._windows.shape[1:]))

    def _add_distance_of_the_held(self, cost: Tensor, hands: Tensor, held: Tensor) -> None:
        near = self._nearness
        hand_middle, hand_change = middle(hands), change(hands)
        for joint in range(hands.shape[2]):
            rows = (held[:, joint] > 0).nonzero()[:, 0]
            if len(rows):
                cosine = hand_middle[rows, joint] @ self._middle[:, joint].T
                angle = 2 * torch.acos(cosine.abs().clamp(max=1.0))
                theirs = self._change[:, joint]
                apart = (
                    hand_change[rows, joint].square().sum(-1)[:, None]
                    + theirs.square().sum(-1)
                    - 2 * cosine.sign() * (hand_change[rows, joint] @ theirs.T)
                )
                believed = torch.exp(-(angle.amin(dim=1, keepdim=True) / _BELIEVED_RADIANS).square())
                held_apart = 0.5 * (angle / math.radians(near.hand_degrees)).square()
                cost[rows] += believed * (held_apart + near.hand_change * apart)

    def _distance_of_the_free(self, windows: Tensor, held: Tensor) -> Tensor:
        """(L, N): squared distance of windows to the recorded ones in the free joints."""
        free = (held == 0).float()
        features = _features(middle(windows), change(windows), self._nearness.change) * free[..., None]
        theirs = self._features
        return (
            features.square().sum((1, 2))[:, None]
            + free @ theirs.square().sum(-1).T
            - 2 * features.flatten(1) @ theirs.flatten(1).T
        )


def middle(windows: Tensor) -> Tensor:
    """(N, T, M, 4) -> (N, M, 4): the orientation in the middle of the window."""
    half = windows.shape[1] // 2
    return rotation.normalize(windows[:, half - 1] + _same_side(windows[:, half], windows[:, half - 1]))


def change(windows: Tensor) -> Tensor:
    """(N, T, M, 4) -> (N, M, 4): the chord from the first pose to the last."""
    return windows[:, -1] - _same_side(windows[:, 0], windows[:, -1])


def _features(middles: Tensor, changes: Tensor, weight: float) -> Tensor:
    return torch.cat([middles, weight * changes], dim=-1)


def _same_side(q: Tensor, other: Tensor) -> Tensor:
    """q or -q, whichever is in the other's hemisphere."""
    return torch.where((q * other).sum(-1, keepdim=True) < 0, -q, q)
