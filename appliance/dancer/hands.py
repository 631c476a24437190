"""Hands: all puppeteers of a show, combined for the puppet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.extrapolation import Extrapolation
from appliance.dancer.held_positions import HeldPosition, in_figure
from appliance.dancer.loop import Placement
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
    places (M, 3), place_weights (M,): joints that are held by position, metres in the figure's frame
    (held_positions.in_figure). The root is the origin there: a hand on it moves the figure's path
    (hips_drawn) and has no weight. by_place: whether each puppeteer gives a position. Two of them may hold
    one joint, one in each way. holds (M,): how firmly each joint is held, in either way.
    """

    SNAPSHOT = (
        *("puppeteers", "mask", "_present", "targets", "weights", "places", "place_weights", "holds"),
        "_extrapolation",
    )

    def __init__(
        self,
        puppeteers: Sequence[Puppeteer],
        joints: Sequence[str],
        window: int = 8,
        placement: Placement | None = None,
        ahead_s: float = 0.0,
    ) -> None:
        """joints: the M moving joints of the network; window: its T poses; placement: from the puppet's own
        floor to the room; ahead_s: how far ahead of its tick blending uses a window on average. Raises
        HandError.
        """
        self.puppeteers = tuple(puppeteers)
        taken: list[tuple[int, bool]] = []  # joints, and whether by place
        places: list[int] = []
        self._turned: list[tuple[slice, Puppeteer]] = []  # with the rows of each, in what follows
        self._placed: list[HeldPosition] = []
        for puppeteer in puppeteers:
            held = puppeteer.joints if isinstance(puppeteer, Springs) else (puppeteer.joint,)
            for joint in held:
                way = _place(joint, joints), isinstance(puppeteer, HeldPosition)
                if way in taken:
                    raise HandError(
                        f"Two hands hold '{joint}'. Give each joint to one hand, or to one by orientation "
                        "and one by position."
                    )
                taken.append(way)
            if isinstance(puppeteer, HeldPosition):
                self._placed.append(puppeteer)
            else:
                self._turned.append((slice(len(places), len(places) + len(held)), puppeteer))
                places += [place for place, _ in taken[-len(held) :]]
        self._places: NDArray[np.intp] = np.array(places, dtype=np.intp)
        self._placed.sort(key=lambda one: not one.is_root)  # the others depend on its result
        self._hips = next((one for one in self._placed if one.is_root), None)
        self._from_room = (placement or Placement()).inverse
        self._ahead_s = ahead_s
        self._placed_at: NDArray[np.intp] = np.array(
            [_place(one.joint, joints) for one in self._placed], dtype=np.intp
        )
        self.by_place = tuple(isinstance(one, HeldPosition) for one in self.puppeteers)
        self._points = np.zeros((len(self._placed), 3), dtype=np.float32)
        self.places = np.zeros((len(joints), 3), dtype=np.float32)
        self.place_weights = np.zeros(len(joints), dtype=np.float32)
        self.holds = np.zeros(len(joints), dtype=np.float32)
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

    def pull(
        self,
        now: float,
        window: FloatArray,
        path: FloatArray | None = None,
        positions: FloatArray | None = None,
    ) -> None:
        """Write all targets of this moment; call it once a tick.

        window (T, M, 4): the phrase's own poses of the moving joints, without sign jumps. The signs of the
        targets jump neither from tick to tick nor from pose to pose. Motion of a joint while
        nothing held it is not extrapolated.
        path (3,): where the figure's root will stand unless a hand draws it; positions (J, 3): where its
        joints are; metres on the puppet's own floor. Only joints that are held by place need them.
        """
        if self._turned:
            self._pull_orientations(now, window)
        if self._placed and path is not None and positions is not None:
            self._pull_places(now, window, path.tolist(), positions)
        np.maximum(self.weights, self.place_weights, out=self.holds)
        if self._hips is not None:
            self.holds[self._placed_at[0]] = self._hips.held_weight

    @property
    def has_places(self) -> bool:
        """Whether any of them holds its joint by place."""
        return bool(self._placed)

    @property
    def hips_drawn(self) -> tuple[float, float, float]:
        """Where the last pull drew the root: x and z on the puppet's own floor (metres), and the weight."""
        if self._hips is None:
            return 0.0, 0.0, 0.0
        x, _, z = self._hips.position()
        return x, z, self._hips.held_weight

    def _pull_places(self, now: float, window: FloatArray, path: list[float], positions: FloatArray) -> None:
        root = path
        for row, puppeteer in enumerate(self._placed):
            given = puppeteer.given
            if given is not None:
                x, z = self._from_room.point(given[0], given[2])
                given = x, given[1], z
            puppeteer.stand(positions[puppeteer.number].tolist(), root, given)
            weight = puppeteer.pull(now).weight
            self._points[row] = puppeteer.position(self._ahead_s)
            if puppeteer is not self._hips:
                self.place_weights[self._placed_at[row]] = weight
            else:
                x, z, weight = self.hips_drawn
                root = [path[0] + weight * (x - path[0]), path[1], path[2] + weight * (z - path[2])]
        facing = quaternion.heading(window[len(window) // 2, 0])
        found = in_figure(self._points, np.array(root, np.float32), facing)
        for row, puppeteer in enumerate(self._placed):
            if puppeteer.habitual is not None:
                found[row] = puppeteer.habitual.bounded(found[row])
        self.places[self._placed_at] = found

    def _pull_orientations(self, now: float, window: FloatArray) -> None:
        np.copyto(self._before, self._present)
        for rows, puppeteer in self._turned:
            self._is_new[rows] = not puppeteer.is_holding
            if not isinstance(puppeteer, Springs):
                puppeteer.start_from(window[0, self._places[rows.start]])
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
        for rows, puppeteer in self._turned:
            if isinstance(puppeteer, Kept):
                place = self._places[rows.start]
                np.multiply(window[:, place], self._signs[rows.start], out=self.targets[:, place])
        np.greater(self.weights, 0.0, out=self.mask)


def _place(joint: str, joints: Sequence[str]) -> int:
    if joint in joints:
        return list(joints).index(joint)
    nearest = UnknownJointError(joint, joints).nearest
    meant = f"Did you mean '{nearest}'? " if nearest else ""
    raise HandError(f"No hand can hold '{joint}': {meant}The network moves {', '.join(joints)}.")
