"""Motion matching with the held joint put in at the end: the reference that a network has to beat.

Clavet 2016, Holden et al. 2020 (without the learned parts), on the training poses themselves. It looks for
the recorded moment whose held joint is as the hand's, and whose others are as the phrase's and as what is
danced now. It needs the recordings, makes nothing new, and cuts from moment to moment; the body is the
dancer's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array
from appliance.studio.evaluation.nearest import Floats, piecewise, without_heading

SEARCH_TICKS = 5
BEFORE, CHANGE = 8, 4  # ticks: the held joint 0.16 s ago; the others' change over 0.08 s
HAND_NOW, HAND_BEFORE, PHRASE, PRESENT = 6.0, 3.0, 1.0, 1.0  # weights of squared distances
MARGIN = 0.15  # another moment is taken if it is cheaper by this share
FADE_TICKS = 15  # in which the difference at a cut disappears


class MotionMatching:
    """The recorded moments of a dancer, and dances made of them."""

    def __init__(self, stretches: Sequence[Array]) -> None:
        """stretches: poses (T, M, 4) that follow each other, the root first.

        Those below half a second are left out. Raises ValueError if none is longer.
        """
        kept = [part for part in stretches if len(part) > BEFORE + FADE_TICKS]
        if not kept:
            raise ValueError("No recording has half a second without a capture error.")
        self._poses = np.concatenate(
            [quaternion.continuous(piecewise(without_heading, part)) for part in kept]
        )
        self._left = np.concatenate(
            [np.arange(len(part))[::-1] for part in kept]
        )  # poses until the stretch ends
        begins = np.cumsum([0, *map(len, kept)])
        self._moments = np.concatenate(
            [
                begin + np.arange(BEFORE, len(part) - FADE_TICKS)
                for begin, part in zip(begins, kept, strict=False)
            ]
        )
        self._six = piecewise(quaternion.to_6d, self._poses)

    def dance(self, phrase: Array, held: int, hand: Array) -> Floats:
        """(T, M, 4): the answer to a hand (T, 4) on joint `held` over a phrase (T, M, 4).

        Headings are removed from all of them. The hand's orientation is put in at the end.
        """
        others = [joint for joint in range(phrase.shape[1]) if joint != held]
        known = piecewise(lambda moments: self._features(moments, held, others), self._moments)
        lengths = np.einsum("nd,nd->n", known, known)
        asked, hands = quaternion.to_6d(phrase[:, others]), quaternion.to_6d(hand)
        faded, danced, place = _Fade(phrase.shape[1]), np.empty(phrase.shape, dtype=np.float32), -1
        for tick in range(len(phrase)):
            cut = place < 0 or self._left[place] == 0
            place += 0 if cut else 1
            if cut or tick % SEARCH_TICKS == 0:
                wanted = np.stack([asked[tick], asked[tick] - asked[max(0, tick - CHANGE)]])
                present = wanted if cut else self._others(place, others)
                mixed = (PHRASE * wanted + PRESENT * present) / (PHRASE + PRESENT)
                query = _weighted(hands[tick], hands[max(0, tick - BEFORE)], mixed)
                costs = lengths - 2 * (known @ query)
                best = int(costs.argmin())
                stays = np.inf if cut else _squared(self._features(place, held, others) - query)
                if costs[best] + _squared(query) < (1 - MARGIN) * stays:
                    place = int(self._moments[best])
                    if tick:
                        faded.begin(danced[tick - 1], self._poses[place])
            danced[tick] = faded.added_to(self._poses[place])
        danced[:, held] = hand
        return danced

    def _others(self, place: NDArray[np.intp] | int, others: list[int]) -> Floats:
        """(..., 2, M - 1, 6): the others at places of the recordings, and their change up to there."""
        now = self._six[place][..., others, :]
        found: Floats = np.stack(
            [now, now - self._six[np.maximum(place - CHANGE, 0)][..., others, :]], axis=-3
        )
        return found

    def _features(self, place: NDArray[np.intp] | int, held: int, others: list[int]) -> Floats:
        """(..., D): what is compared of places of the recordings, weighted."""
        before = np.maximum(place - BEFORE, 0)
        return _weighted(
            self._six[place][..., held, :], self._six[before][..., held, :], self._others(place, others)
        )


class _Fade:
    """The remainder of a cut: the difference of each joint, which fades."""

    def __init__(self, joints: int) -> None:
        self._none = np.tile(quaternion.IDENTITY, (joints, 1))
        self._offset, self._ticks = self._none, 0

    def begin(self, before: Floats, after: Floats) -> None:
        """The dance cuts from a pose (M, 4) to another one."""
        self._offset = quaternion.multiply(before, quaternion.inverse(after))
        self._ticks = FADE_TICKS

    def added_to(self, pose: Floats) -> Floats:
        """A pose of the new moment (M, 4) with what is left of the cut; once a tick."""
        share = self._ticks / (FADE_TICKS + 1)
        self._ticks = max(0, self._ticks - 1)
        left = quaternion.slerp(self._none, self._offset, np.full(len(pose), ease(share)))
        faded: Floats = quaternion.multiply(left, pose).astype(np.float32)
        return faded


def _weighted(now: Array, before: Array, others: Array) -> Floats:
    """(..., D): held joint now and before (..., 6), others (..., 2, M - 1, 6), by roots of their weights."""
    parts = [
        np.sqrt(HAND_NOW) * now,
        np.sqrt(HAND_BEFORE) * before,
        np.sqrt(PHRASE + PRESENT) * others.reshape(*others.shape[:-3], -1),
    ]
    return np.concatenate(parts, axis=-1).astype(np.float32)


def _squared(vector: Floats) -> float:
    return float(vector @ vector)
