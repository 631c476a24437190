"""Hands: all puppeteers of a show, combined for the puppet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.extrapolation import Extrapolation
from appliance.dancer.puppeteers import Kept, Puppeteer
from appliance.dancer.slerp import FloatArray
from appliance.dancer.springs import Springs
from appliance.pose import quaternion
from appliance.pose.skeleton import UnknownJointError


class HandError(ValueError):
    """A hand that cannot hold its joint: which one, why, and which joints exist."""


class Hands:
    """Which of the M moving joints are held: mask (M,), targets (T, M, 4) and weights (M,).

    targets: one orientation for each pose of the window, the present one first. The motion of a hand is
    extrapolated over the window; a kept joint has the orientations of the phrase's own window.
    """

    def __init__(self, puppeteers: Sequence[Puppeteer], joints: Sequence[str], window: int = 8) -> None:
        """joints: the M moving joints of the network; window: its T poses. Raises HandError."""
        self.puppeteers = tuple(puppeteers)
        places: list[int] = []
        self._rows: list[slice] = []  # of each puppeteer, in what follows
        for puppeteer in puppeteers:
            held = puppeteer.joints if isinstance(puppeteer, Springs) else (puppeteer.joint,)
            self._rows.append(slice(len(places), len(places) + len(held)))
            for joint in held:
                place = _place(joint, joints)
                if place in places:
                    raise HandError(f"Two hands hold '{joint}'. Give each joint to one hand only.")
                places.append(place)
        self._places: NDArray[np.intp] = np.array(places, dtype=np.intp)
        self.mask: NDArray[np.bool_] = np.zeros(len(joints), dtype=np.bool_)
        self.targets = np.tile(quaternion.IDENTITY, (window, len(joints), 1))
        self.weights = np.zeros(len(joints), dtype=np.float32)

        count = len(self._places)
        self._present = np.tile(quaternion.IDENTITY, (count, 1))
        self._before = self._present.copy()
        self._signs = np.empty((count, 1), dtype=np.float32)
        self._is_new = np.empty((count, 1), dtype=np.bool_)
        self._extrapolation = Extrapolation(count, window)
        self._ahead = np.empty((window, count, 4), dtype=np.float32)

    def pull(self, now: float, window: FloatArray) -> None:
        """Write all targets of this moment; call it once a tick.

        window (T, M, 4): the phrase's own poses of the moving joints, without sign jumps. The signs of the
        targets jump neither from tick to tick nor from pose to pose. Motion of a joint while
        nothing held it is not extrapolated.
        """
        if not self.puppeteers:
            return
        np.copyto(self._before, self._present)
        for rows, puppeteer in zip(self._rows, self.puppeteers, strict=True):
            self._is_new[rows] = not puppeteer.is_holding
            if isinstance(puppeteer, Kept):
                puppeteer.follow_phrase(window[0, self._places[rows.start]])
            target = puppeteer.pull(now)
            self._present[rows] = (
                puppeteer.orientations if isinstance(puppeteer, Springs) else target.orientation
            )
            self.weights[self._places[rows]] = target.weight
        np.einsum("hk,hk->h", self._present, self._before, out=self._signs[:, 0])
        np.copysign(1.0, self._signs, out=self._signs)
        np.multiply(self._present, self._signs, out=self._present)
        self._extrapolation(self._present, self._is_new, out=self._ahead)
        self.targets[:, self._places] = self._ahead
        for rows, puppeteer in zip(self._rows, self.puppeteers, strict=True):
            if isinstance(puppeteer, Kept):
                place = self._places[rows.start]
                np.multiply(window[:, place], self._signs[rows.start], out=self.targets[:, place])
        np.greater(self.weights, 0.0, out=self.mask)

    def state(self) -> dict[str, Any]:
        """What later targets depend on, for `restore`: plain values and copies of arrays."""
        return {
            "puppeteers": [puppeteer.state() for puppeteer in self.puppeteers],
            "mask": self.mask.copy(),
            "present": self._present.copy(),
            "targets": self.targets[:, self._places].copy(),
            "weights": self.weights.copy(),
            "extrapolation": self._extrapolation.state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state of the same show's hands."""
        for puppeteer, kept in zip(self.puppeteers, state["puppeteers"], strict=True):
            puppeteer.restore(kept)
        self.mask[:], self._present[:], self.weights[:] = state["mask"], state["present"], state["weights"]
        self.targets[:, self._places] = state["targets"]
        self._extrapolation.restore(state["extrapolation"])


def _place(joint: str, joints: Sequence[str]) -> int:
    if joint in joints:
        return list(joints).index(joint)
    nearest = UnknownJointError(joint, joints).nearest
    meant = f"Did you mean '{nearest}'? " if nearest else ""
    raise HandError(f"No hand can hold '{joint}': {meant}The network moves {', '.join(joints)}.")
