"""Onsets: where a move starts and a foot lands, so that the strings are struck there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array
from appliance.pose.roles import roles_of
from appliance.pose.skeleton import Skeleton

Floats = NDArray[np.float64]
SUDDEN_M_S = 0.6  # by so much a bone is faster than it was on average: a move starts
FULL_M_S = 2.5  # and by so much, or a foot that falls as fast, strikes fully
_MEAN_S = 0.2  # window of that average
_REST_S = 0.2  # from one strike of a string to its next
_FALLS_M_S, _STANDS_M_S = 0.3, 0.1  # a landing: faster downwards than the first, then slower than the second
_LOW_M = 0.12  # above where a foot stands: higher up it stops in the air


class Onsets:
    """Strikes of the strings of `bones` (B, 2) of a skeleton. Time is an argument."""

    def __init__(self, skeleton: Skeleton, bones: NDArray[np.intp]) -> None:
        roles = roles_of(skeleton.names)
        feet = [roles[role] for role in ("left foot", "right foot") if role in roles]
        self._strings = {foot: int(at) for foot in feet for at in np.flatnonzero(bones[:, 1] == foot)}
        self._feet = np.array(list(self._strings), np.intp)
        self._means = np.zeros(len(bones))
        self._was_sudden = np.zeros(len(bones), bool)
        self._struck_at = np.full(len(bones), -np.inf)
        self._floors = np.full(len(self._feet), np.inf)  # where each foot stood lowest
        self._heights: Floats | None = None
        self._falling = np.zeros(len(self._feet))

    def strikes(self, speeds: Floats, positions: Array, now: float, elapsed_s: float) -> Floats:
        """How strongly each string is struck now (B,), 0..1. speeds: of the bones (B,), metres a second."""
        sudden = speeds - self._means
        self._means = self._means + sudden * (1.0 - np.exp(-elapsed_s / _MEAN_S))
        starts = (sudden > SUDDEN_M_S) & ~self._was_sudden
        self._was_sudden = sudden > SUDDEN_M_S
        strength = np.where(starts, np.minimum(sudden / FULL_M_S, 1.0), 0.0)
        for foot, fell in zip(self._feet, self._landings(positions, elapsed_s), strict=True):
            strength[self._strings[int(foot)]] = max(strength[self._strings[int(foot)]], fell)
        strength[now - self._struck_at < _REST_S] = 0.0
        self._struck_at[strength > 0.0] = now
        return strength

    def begin_anew(self) -> None:
        """Nothing that was before counts: no pose came."""
        self._heights = None

    def _landings(self, positions: Array, elapsed_s: float) -> Floats:
        """How hard each foot has just landed, 0..1."""
        heights = positions[self._feet, 1].astype(float)
        landed = np.zeros(len(heights))
        if self._heights is not None:
            falling = (self._heights - heights) / elapsed_s
            is_down = (self._falling > _FALLS_M_S) & (falling < _STANDS_M_S)
            self._floors = np.minimum(self._floors, heights)
            landed = np.where(
                is_down & (heights < self._floors + _LOW_M), np.minimum(self._falling / FULL_M_S, 1.0), 0.0
            )
            self._falling = falling
        self._heights = heights
        return landed
