"""Live motion: a live dancer's motion capture in place of the phrase."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from appliance.dancer.extrapolation import Extrapolation
from appliance.dancer.slerp import FloatArray, Slerp
from appliance.dancer.takeover import Takeover
from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.possible import FARTHEST_M, most_step_m

SILENT_S = 0.5  # after which the phrase plays on
SHORTEST_S, LONGEST_S = 0.004, 0.1  # between two poses of a stream: 10 to 250 a second
_FOLLOW = 0.1  # share of a new interval in the estimate
_UNIT = 0.1  # a quaternion this far from unit length is invalid
_JOINT_FADE_S = 0.5  # in which a joint goes over to the stream, or back to the phrase


class Live(Takeover):
    """Lays a stream of poses over the phrase's window, fading in and out; once a tick.

    Poses come at any rate, and are interpolated between the last two: that costs one interval. The window's
    later poses are extrapolated as those of a hand are. Joints that do not come stay with the phrase. If the
    stream gives the root's position, the figure moves by the same amount from its place at the takeover;
    otherwise it stays on the phrase's path. A root that jumps farther than anybody moves takes the figure
    nowhere: it
    goes on from where it stood.
    A stream that is silent for SILENT_S gives way to the phrase, and comes back with its next pose.

    jumps: how often its root jumped.
    """

    SNAPSHOT = (
        *("_before", "_newest", "_present", "_root", "_offset", "_has_root", "_is_new", "_comes", "_came"),
        *("_is_whole", "_arrival", "_interval_s", "_extrapolation", "_signs"),
    )
    TIMES = ("_arrival",)

    jumps = 0

    def __init__(self, joints: int, window: int, tick_s: float = 0.02) -> None:
        super().__init__(tick_s)
        # Between two dances that pass opposite orientations, the short way would change sides.
        self._slerp, self._over = Slerp(joints), Slerp(window * joints, short=False)
        self._signs = np.zeros((joints, 1), np.float32)  # which the phrase takes in a fade; 0: none yet
        self._phrase = np.empty((window, joints, 4), np.float32)
        self._extrapolation = Extrapolation(joints, window)
        self._is_new = np.ones((joints, 1), dtype=np.bool_)
        self._before, self._newest, self._present, self._looked = np.tile(quaternion.IDENTITY, (4, joints, 1))
        self._all = np.ones(joints, dtype=np.bool_)
        self._comes = np.zeros(joints, dtype=np.bool_)  # joints of the newest pose
        self._came, self._follows = np.zeros((2, joints), dtype=np.float32)  # how far each is the stream's
        self._phrases_share = np.empty((window, joints), dtype=np.float32)
        self._joint_step = tick_s / _JOINT_FADE_S
        self._is_whole = False  # all joints come, and all are the stream's: nothing is done joint by joint
        self._window = np.tile(quaternion.IDENTITY, (window, joints, 1))
        self._roots = np.zeros((window, 3), dtype=np.float32)
        self._root = np.zeros((2, 3), dtype=np.float32)  # root of the previous and of the newest pose
        self._offset = np.zeros(3, dtype=np.float32)
        self._has_root = False
        self._arrival, self._interval_s = -math.inf, 0.02

    @property
    def newest(self) -> FloatArray:
        """The newest pose (J, 4) of the stream."""
        newest: FloatArray = self._newest
        return newest

    def share_of(self, joints: Sequence[int]) -> float:
        """The same of these joints: less where they stay with the phrase."""
        return self.share * (float(self._came[[*joints]].mean()) if joints else 1.0)

    def silent_s(self, now: float) -> float:
        """Seconds since its last pose; infinite before the first."""
        return now - self._arrival

    def hear(self, pose: FloatArray, root: FloatArray, arrival: float, phrase: FloatArray) -> bool:
        """A pose (J, 4) of local quaternions, its root (3,) in metres; False: no pose.

        Joints that do not come, and a root that is unknown, are not numbers. phrase (J, 4): the phrase's pose
        of this moment, whose signs the stream takes over.
        """
        lengths = np.sqrt(np.einsum("jk,jk->j", pose, pose))
        comes = self._all
        if not (np.abs(lengths - 1.0) < _UNIT).all():
            comes = np.logical_not(np.isnan(pose).all(axis=1))
            if not comes.any() or not (np.abs(lengths[comes] - 1.0) < _UNIT).all():
                return False
        interval_s, was_silent = arrival - self._arrival, self.silent_s(arrival) > SILENT_S
        if not was_silent:
            self._interval_s += _FOLLOW * (min(max(interval_s, SHORTEST_S), LONGEST_S) - self._interval_s)
        np.copyto(self._before, self._newest)
        np.divide(pose, lengths[:, None], out=self._newest, where=comes[:, None])
        reference = phrase if was_silent and not self._share else self._before
        if not self._is_whole:
            reference = np.where((self._came == 0.0)[:, None], phrase, reference)
        self._newest *= quaternion.sides(self._newest, reference)
        knows_root = bool((np.abs(root) <= FARTHEST_M).all())
        if self._has_root and not was_silent:
            if not knows_root:
                root, knows_root = self._root[1].copy(), True  # unknown for a moment: the last good one
            self._carry_on(root, min(max(interval_s, SHORTEST_S), LONGEST_S))
        self._root[0] = self._root[1]
        self._root[1] = root if knows_root else 0.0
        if was_silent:
            np.copyto(self._before, self._newest)
            self._is_new[:] = True
        elif not self._is_whole:
            fresh = comes & ~self._comes
            self._before[fresh], self._is_new[fresh] = self._newest[fresh], True
        self._comes[:] = comes
        self._is_whole = self._is_whole and comes is self._all
        if was_silent or not self._has_root:
            self._root[0] = self._root[1]
            self._offset[:] = np.nan  # taken when the next window is laid over
        self._has_root, self._arrival = knows_root, arrival
        return True

    def lay_over(self, now: float, window: FloatArray, roots: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The window (T, J, 4) and the roots (T, 3) that the puppet starts from, of the phrase's own."""
        comes = self._chosen and self.silent_s(now) <= SILENT_S
        self._fade(comes)
        if not self._share:
            self._offset[:] = np.nan
            self._signs[:] = 0.0
            self._came[:] = self._comes
            self._is_whole = bool(self._comes.all())
            return window, roots
        share = min(max((now - self._arrival) / self._interval_s, 0.0), 1.0)
        self._slerp(self._before, self._newest, share, out=self._present)
        shares: FloatArray | float = 1.0 - self.share
        if not self._is_whole:
            shares = self._by_joints(window)
        self._extrapolation(self._present, self._is_new, out=self._window)
        self._is_new[:] = False
        rows = self._window.reshape(-1, 4)
        self._take_sides(window, shares)
        self._over(rows, self._phrase.reshape(-1, 4), shares, out=rows)
        self._roots[:] = roots
        if self._has_root:
            root = self._root[0] + share * (self._root[1] - self._root[0])
            if np.isnan(self._offset[0]):
                self._offset[:] = roots[0] - root
            self._roots += np.float32(self.share) * (root + self._offset - self._roots)
        return self._window, self._roots

    def _by_joints(self, window: FloatArray) -> FloatArray:
        """(T*J,): how much stays the phrase's while not all joints come; `_present` follows it there."""
        came, step = self._came, self._joint_step
        np.clip(self._comes, came - step, came + step, out=came)
        self._is_whole = bool(came.min() == 1.0)
        stays = (came == 0.0)[:, None]
        np.copyto(self._present, window[0], where=stays)
        self._is_new |= stays
        self._follows[:] = ease(came)
        self._phrases_share[:] = 1.0 - self.share * self._follows
        return self._phrases_share.reshape(-1)

    def _take_sides(self, window: FloatArray, shares: FloatArray | float) -> None:
        """The phrase's window (T, J, 4) in the stream's hemisphere, as of when a joint was last of one of the
        two only.
        """
        of_joint = np.broadcast_to(shares, window.size // 4)[: len(self._signs)]
        settled = ((of_joint == 0.0) | (of_joint == 1.0))[:, None] | (self._signs == 0.0)
        np.copyto(self._signs, quaternion.sides(self._present, window[0]), where=settled)
        np.multiply(window, self._signs, out=self._phrase)

    def look(self, now: float) -> tuple[FloatArray, FloatArray] | None:
        """The stream's own pose (J, 4) and root (3,) at this time, whatever the puppet dances; None while it
        is silent. Overwritten by the next call.
        """
        if self.silent_s(now) > SILENT_S:
            return None
        share = min(max((now - self._arrival) / self._interval_s, 0.0), 1.0)
        self._slerp(self._before, self._newest, share, out=self._looked)
        return self._looked, self._root[0] + share * (self._root[1] - self._root[0])

    def stand_anew(self) -> None:
        """Take the figure from where it stands to the stream's root, as at a takeover."""
        self._offset[:] = np.nan

    def _carry_on(self, root: FloatArray, interval_s: float) -> None:
        """Where the root has jumped since the pose before, count places from there."""
        jump = root - self._root[1]
        if math.hypot(*jump.tolist()) > most_step_m(interval_s):
            self.jumps += 1
            self._root += jump
            self._offset -= jump
