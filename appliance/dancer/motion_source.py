"""Motion source: endless playback of a phrase in windows of 8 poses, controllable while it runs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from appliance.dancer.loop import Loop, Placement
from appliance.dancer.slerp import FloatArray, Slerp
from appliance.pose.recording import Recording

FPS = 50.0
MAX_RATE = 4.0
RATE_CHANGE_PER_TICK = 0.08  # from standing to full speed in a quarter of a second
_ROWS = 256  # poses of the played motion before it moves back to the start of its memory
_X, _Y, _Z, _LIFT, _AT = range(5)  # columns of the played track


class PhraseError(ValueError):
    """The phrase, or the excerpt of it, has fewer poses than a window."""


@dataclass
class _Head:
    """A reading head: its position in a loop (frames and fractions), where that stands on the stage, and the
    pose (J, 4) that it read last; the next one takes its signs.
    """

    loop: Loop
    position: float
    pose: FloatArray
    placement: Placement = field(default_factory=Placement)


class Playback:
    """Plays a phrase for ever. Tick by tick: read window() and roots(), then advance().

    The motion that it plays is one continuous stream; the window is its next 8 poses, the first of them being
    the pose of this tick. Every change (jump, excerpt, rate) enters at the far end of the window, 7 ticks
    before it is seen. The root's position and heading are carried on through loops and jumps.
    Times are seconds of the phrase. Control methods may be called from any thread.
    """

    def __init__(
        self,
        phrase: Recording,
        *,
        start_s: float = 0.0,
        end_s: float | None = None,
        rate: float = 1.0,
        crossfade_s: float = 0.5,
        window: int = 8,
        lifts: FloatArray | None = None,
    ) -> None:
        """lifts (N,): height in metres of the phrase above the floor, carried along for the grounding.

        Raises PhraseError, or ValueError for an excerpt or a rate that makes no sense.
        """
        source = phrase.resampled(FPS)
        self._window = window
        self._poses = np.ascontiguousarray(source.poses, dtype=np.float32)
        self._track = np.zeros((len(source), _AT), dtype=np.float32)
        self._track[:, :_LIFT] = source.roots
        if lifts is not None:
            self._track[:, _LIFT] = lifts
        self._fade = max(0, round(crossfade_s * FPS))
        self._rate = self._wanted_rate = _checked_rate(rate)

        joints = len(source.skeleton)
        self._between_frames = Slerp(joints)
        self._between_heads = Slerp(joints, short=False)
        self._sampled = np.empty((joints, 4), dtype=np.float32)
        self._entering_track = np.empty(5, dtype=np.float32)
        self._played = np.zeros((_ROWS, joints, 4), dtype=np.float32)
        self._played[..., 0] = 1.0
        self._played_track = np.zeros((_ROWS, 5), dtype=np.float32)
        self._signs = np.empty((joints, 1), dtype=np.float32)

        self._excerpt = self._loop(start_s, end_s)
        self._head = _Head(self._excerpt, 0.0, self._excerpt.poses[0].copy())
        self._leaving: _Head | None = None
        self._fade_tick = 0
        self._request: tuple[Loop, float] | None = None
        self.jumped = False
        self._end = 0
        for _ in range(window):
            self._push()

    def window(self) -> FloatArray:
        """The next poses (window, J, 4) of the motion, without sign jumps; valid until advance()."""
        return self._played[self._end - self._window : self._end]

    def roots(self) -> FloatArray:
        """The root's position (window, 3) in metres at the poses of the window."""
        return self._played_track[self._end - self._window : self._end, :3]

    @property
    def lift(self) -> float:
        """How far the phrase is above the floor (metres) at the window's first pose."""
        return float(self._played_track[self._end - self._window, _LIFT])

    @property
    def position_s(self) -> float:
        """Where in the phrase (seconds) the window's first pose comes from."""
        return float(self._played_track[self._end - self._window, _AT])

    @property
    def rate(self) -> float:
        """Speed: 1 as recorded, 0 standing, negative backwards. Set it; it is reached within a second."""
        return self._wanted_rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._wanted_rate = _checked_rate(rate)

    def jump(self, to_s: float) -> None:
        """Go on at another second of the phrase, crossfaded; the nearest one inside the excerpt is taken.

        During a crossfade it waits until that one is over; of several that wait the last counts.
        """
        loop = self._excerpt
        self._request = loop, min(max((to_s - loop.start_s) * FPS, 0.0), loop.length - 1.0)

    def excerpt(self, start_s: float, end_s: float | None = None) -> None:
        """Play another part of the phrase from its start on, crossfaded. Raises as the constructor does."""
        self._excerpt = self._loop(start_s, end_s)
        self._request = self._excerpt, 0.0

    def advance(self) -> None:
        """Go one tick on. `jumped` tells whether a jump was taken up in it."""
        self.jumped = False
        if self._request is not None and self._leaving is None:
            (loop, position), self._request = self._request, None
            self._cross_over(loop, position)
            self.jumped = True
        elif self._rate < 0 and self._leaving is None and self._head.position < self._head.loop.fade:
            # Backwards out of the first frames, before the first loop: the end does not lead here by itself.
            loop = self._head.loop
            self._cross_over(loop, self._head.position + loop.period)
        self._rate += min(max(self._wanted_rate - self._rate, -RATE_CHANGE_PER_TICK), RATE_CHANGE_PER_TICK)
        self._push()

    def _loop(self, start_s: float, end_s: float | None) -> Loop:
        count = len(self._poses)
        first = round(start_s * FPS)
        last = count if end_s is None else min(round(end_s * FPS), count)
        if first < 0 or last - first < self._window:
            part = f"from {start_s:g} s to {end_s if end_s is not None else count / FPS:g} s"
            raise PhraseError(
                f"The phrase has {count} poses ({count / FPS:.2f} s); the part {part} leaves "
                f"{max(last - first, 0)}, and the puppet needs {self._window}. "
                "Nothing can be danced. Choose a longer part or a longer phrase."
            )
        return Loop(self._poses[first:last], self._track[first:last], self._fade, first / FPS)

    def _push(self) -> None:
        """Append one pose to the played motion and move the heads."""
        if self._end == _ROWS:
            self._move_to_start()
        pose, track = self._played[self._end], self._played_track[self._end]
        leaving = self._leaving
        if leaving is None:
            self._sample(self._head, track)
            pose[:] = self._head.pose
        else:
            self._fade_tick += 1
            share = self._fade_tick / (self._fade + 1)
            share = share * share * (3 - 2 * share)
            self._sample(leaving, track)
            self._sample(self._head, self._entering_track)
            self._between_heads(leaving.pose, self._head.pose, share, pose)
            track += share * (self._entering_track - track)
            track[_AT] = self._entering_track[_AT]
            self._move(leaving)
            if self._fade_tick >= self._fade:
                self._leaving = None
        self._move(self._head)
        self._end += 1

    def _sample(self, head: _Head, track: FloatArray) -> None:
        """Take the pose and the track (5,) at a head's position, placed on the stage."""
        loop, placement, pose = head.loop, head.placement, self._sampled
        index = int(head.position)
        share = head.position - index
        if share:
            self._between_frames(loop.poses[index], loop.poses[index + 1], share, pose)
            track[:_AT] = loop.track[index] + share * (loop.track[index + 1] - loop.track[index])
        else:
            pose[:] = loop.poses[index]
            track[:_AT] = loop.track[index]
        w, x, y, z = pose[0].tolist()
        cosine, sine = math.cos(placement.yaw / 2), math.sin(placement.yaw / 2)
        pose[0] = cosine * w - sine * y, cosine * x + sine * z, cosine * y + sine * w, cosine * z - sine * x
        track[_X], track[_Z] = placement.point(float(track[_X]), float(track[_Z]))
        track[_AT] = loop.start_s + head.position / FPS
        np.einsum("jk,jk->j", pose, head.pose, out=self._signs[:, 0])
        np.copysign(1.0, self._signs, out=self._signs)
        np.multiply(pose, self._signs, out=head.pose)

    def _move(self, head: _Head) -> None:
        loop, before = head.loop, head.position
        head.position += self._rate
        if head.position >= loop.length:
            head.position -= loop.period
            head.placement = head.placement.after(loop.step)
        elif before >= loop.fade > head.position and self._rate < 0:
            head.position += loop.period
            head.placement = head.placement.after(loop.step.inverse)
        elif head.position < 0:
            head.position = 0.0

    def _cross_over(self, loop: Loop, position: float) -> None:
        """Begin to fade from the present head to another place, put where the figure stands."""
        leaving = self._head
        entering = _Head(loop, position, leaving.pose.copy())
        entering.placement = Placement.bringing(_standing(entering), _standing(leaving))
        self._head = entering
        self._leaving = leaving if self._fade else None
        self._fade_tick = 0

    def _move_to_start(self) -> None:
        kept = self._window
        self._played[:kept] = self._played[-kept:]
        self._played_track[:kept] = self._played_track[-kept:]
        self._end = kept


def _standing(head: _Head) -> tuple[float, float, float]:
    """Where a head's root stands on the stage: x, z in metres, heading in radians."""
    index = int(head.position)
    x, _, z = head.loop.track[index, :3].tolist()
    w, _, y, _ = head.loop.poses[index, 0].tolist()
    return *head.placement.point(x, z), 2 * math.atan2(y, w) + head.placement.yaw


def _checked_rate(rate: float) -> float:
    if not -MAX_RATE <= rate <= MAX_RATE:
        raise ValueError(f"The rate is {rate:g}; playback can run from {-MAX_RATE:g} to {MAX_RATE:g} times.")
    return rate
