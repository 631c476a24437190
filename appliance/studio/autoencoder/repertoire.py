"""The repertoire: the recorded windows, searched for what the dancer does while a joint is held.

What the dancer usually does near a window is the mean of the nearest recorded windows, weighted by their
nearness (a kernel regression); with a hand, nearness includes how the joint is held. A single nearest window
would jump between takes from tick to tick. The answer is the usual with the hand, plus the share `own` of
what distinguishes the window from the usual without it: with 1, a hand that holds a joint where the phrase
has it changes nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.autoencoder import slerp_towards

_SEARCH_ROWS = 512  # at a time: each search is a matrix product
_BELIEVED_RADIANS = 1.5  # a hand this far from everything that the dancer does has weight e^-1
_SHARPNESS = 3.0  # the furthest neighbour has e^-3 of the nearest one's weight


@dataclass(frozen=True)
class Nearness:
    """What makes a recorded window the answer to a hand.

    The sum of: squared chords (half the angle) of the free joints, and of their change over the window times
    `change`; the held joints' squared angle to the hand (radians) times `hand`, and the squared chord between
    their changes times `hand_change`.
    """

    neighbours: int = 60
    searched: int = 24_000  # windows at most, evenly spaced: always the same ones, for one answer
    change: float = 1.5
    hand: float = 120.0
    hand_change: float = 2.0
    own: float = 0.78  # of what distinguishes the window from the usual, kept in the free joints


class Repertoire:
    """Heading-free windows (N, T, M, 4), thinned out, with the features that are searched."""

    def __init__(self, windows: Tensor, nearness: Nearness) -> None:
        self._nearness = nearness
        self._windows = windows[:: max(math.ceil(len(windows) / nearness.searched), 1)].contiguous()
        self._middle, self._change = middle(self._windows), change(self._windows)
        self._features = _features(self._middle, self._change, nearness.change)

    def usual(self, windows: Tensor) -> Tensor:
        """What the dancer usually does near windows (L, T, M, 4)."""
        nobody = windows.new_zeros(1, windows.shape[2])
        costs = (self._distance_of_the_free(rows, nobody) for rows in torch.split(windows, _SEARCH_ROWS))
        return torch.cat([self._mean_of_the_nearest(cost) for cost in costs])

    def answers(self, windows: Tensor, hands: Tensor, held: Tensor) -> Tensor:
        """What the dancer does near windows with hands, both (L, T, M, 4), held by weights (L, M)."""
        rows = (torch.split(all_rows, _SEARCH_ROWS) for all_rows in (windows, hands, held))
        return torch.cat([self._answers(*row) for row in zip(*rows, strict=True)])

    def _answers(self, windows: Tensor, hands: Tensor, held: Tensor) -> Tensor:
        near = self._nearness
        cost = self._distance_of_the_free(windows, held)
        usual = self._mean_of_the_nearest(cost)
        hand_middle, hand_change = middle(hands), change(hands)
        for joint in range(windows.shape[2]):
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
                weight = held[rows, joint][:, None] * believed
                cost[rows] += weight * (near.hand * angle.square() + near.hand_change * apart)
        with_hand = self._mean_of_the_nearest(cost)
        own = rotation.multiply(rotation.inverse(usual), windows)
        still = torch.tensor([1.0, 0.0, 0.0, 0.0], device=windows.device).expand_as(own)
        share = (near.own * (held == 0))[:, None, :, None].expand_as(own[..., :1])
        return rotation.multiply(with_hand, slerp_towards(still, own, share))

    def _mean_of_the_nearest(self, cost: Tensor) -> Tensor:
        """(L, T, M, 4): mean of the windows with the least cost (L, N)."""
        distance, nearest = cost.topk(min(self._nearness.neighbours, cost.shape[1]), largest=False)
        spread = (distance[:, -1:] - distance[:, :1]).clamp_min(1e-6)
        share = torch.softmax(-_SHARPNESS * (distance - distance[:, :1]) / spread, dim=-1)
        return rotation.normalize(torch.einsum("lk,lktmq->ltmq", share, self._windows[nearest]))

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
    """q or -q, whichever lies on the side of the other."""
    return torch.where((q * other).sum(-1, keepdim=True) < 0, -q, q)
