"""Poses between the ticks: what the display shows at its own rate, of frames that are carried on."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import JointFrame
from appliance.pose import quaternion
from appliance.projector.moment import TRAIL_S, Moment, PuppetMoment
from appliance.projector.prediction import SPAN, Figure, Prediction

TICK_S = 0.02
_CAPACITY = 64  # frames: the ring of the shared frame, a little more than the trail
_READ_AT_ONCE = 3  # a display of 25 Hz or more misses none; after a gap all of them are read
_LONGEST_GAP_S = 0.1  # a longer one is not bridged: the later pose simply follows
_SLEW = 0.1  # how much faster or slower the dance may seem while the delay is corrected


class _Seen(NamedTuple):
    tick: int
    time: float
    left: float  # when it left the stage
    figures: tuple[Figure, ...]  # one for each puppet
    ahead: tuple[Figure, ...]  # predicted for `prediction_s` after `time`

    @property
    def danced_s(self) -> float:
        """Its time by the dance's own clock."""
        return TICK_S * self.tick


class Interpolation:
    """Follows one stage's frames. Between two, positions and holds are linear, world rotations slerped.

    The wall is one tick behind the newest possible frame, so that the frame after the wanted one is usually
    there; if not, the newest one is held. Each frame is carried on by prediction_s, which makes up for that
    tick: the frames are predicted, then interpolated. So a wrong prediction never shows as a jump.
    """

    def __init__(self, reader: FrameReader, prediction_s: float = 0.0) -> None:
        self._reader, self._prediction_s = reader, prediction_s
        self._predict: Prediction | None = None
        self._seen: deque[_Seen] = deque(maxlen=_CAPACITY)
        self._tick = -1
        self._latency_s: float | None = None  # from a frame's time to its leaving the stage
        self._before = self._left_s = 0.0

    @property
    def left_stage(self) -> float:
        """When what the last moment shows left the stage, monotonic seconds."""
        return self._left_s

    @property
    def newest(self) -> float | None:
        """Time of the newest frame, monotonic seconds; None before the first."""
        return self._seen[-1].time if self._seen else None

    def take(self, now: float) -> None:
        """Read the frames that the stage has written since the last call."""
        frames = self._reader.frames(_READ_AT_ONCE if self._seen else _CAPACITY, now)
        if self._seen and frames and frames[0].tick > self._tick + 1:
            frames = self._reader.frames(_CAPACITY, now)
        for frame in frames:
            self._note(frame)
        self._follow_latency(now)

    def moment(self, now: float) -> Moment | None:
        """The moment to draw at `now` (monotonic seconds); None before the first frame."""
        if not self._seen:
            return None
        danced_s = max(now - TICK_S - (self._latency_s or 0.0), self._seen[0].time)
        after = next((k for k, seen in enumerate(self._seen) if seen.time > danced_s), len(self._seen))
        before = self._seen[after - 1]
        figures, ticks = before.ahead, (danced_s - before.time) / TICK_S
        if after < len(self._seen):
            later = self._seen[after]
            figures = _between(before, later, danced_s)
            ticks = (danced_s - before.time) / (later.time - before.time) * (later.tick - before.tick)
        time_s = TICK_S * (before.tick + ticks) + self._prediction_s
        trail = [seen for seen in self._seen if time_s - TRAIL_S <= seen.danced_s <= time_s] or [before]
        trails = zip(*(seen.figures for seen in trail), strict=True)
        puppets = (
            PuppetMoment(now.positions, now.world, [(one.positions, one.world) for one in before], now.holds)
            for now, before in zip(figures, trails, strict=True)
        )
        self._left_s = min(danced_s, self._seen[-1].time) + (self._latency_s or 0.0)
        return Moment(time_s, [seen.danced_s for seen in trail], tuple(puppets))

    def _note(self, frame: JointFrame) -> None:
        if frame.tick <= self._tick or (self._seen and frame.frame_time <= self._seen[-1].time):
            return
        self._tick = frame.tick
        figures = tuple(Figure(one.positions, one.world, one.holds) for one in frame.puppets)
        ahead = self._ahead(frame.tick, figures)
        self._seen.append(_Seen(frame.tick, frame.frame_time, frame.left, figures, ahead))

    def _ahead(self, tick: int, figures: tuple[Figure, ...]) -> tuple[Figure, ...]:
        """The figures as predicted; as they are after a gap, or with prediction off."""
        if not self._prediction_s or self._reader.facts is None or len(self._seen) < 2 * SPAN:
            return figures
        before, earlier = self._seen[-SPAN], self._seen[-2 * SPAN]
        if (before.tick, earlier.tick) != (tick - SPAN, tick - 2 * SPAN):
            return figures
        if self._predict is None:
            self._predict = Prediction(self._reader.facts.skeleton)
        past = zip(figures, before.figures, earlier.figures, strict=True)
        return tuple(self._predict(*three, self._prediction_s / TICK_S) for three in past)

    def _follow_latency(self, now: float) -> None:
        """Follow the latency of nine in ten frames, so slowly that it does not show."""
        if not self._seen:
            return
        latencies = sorted(min(max(seen.left - seen.time, 0.0), TICK_S) for seen in self._seen)
        latency_s = latencies[(len(latencies) * 9) // 10]
        if self._latency_s is None:
            self._latency_s = latency_s
        else:
            most_s = _SLEW * max(0.0, now - self._before)
            self._latency_s += min(max(latency_s - self._latency_s, -most_s), most_s)
        self._before = now


def _between(before: _Seen, after: _Seen, time_s: float) -> tuple[Figure, ...]:
    """The predicted figures, interpolated to a time between two frames."""
    gap_s = after.time - before.time
    if gap_s > _LONGEST_GAP_S:
        return before.ahead
    share = np.float32((time_s - before.time) / gap_s)
    return tuple(
        Figure(
            (one.positions + share * (next_one.positions - one.positions)).astype(np.float32),
            quaternion.slerp(one.world, next_one.world, share).astype(np.float32),
            (one.holds + share * (next_one.holds - one.holds)).astype(np.float32),
        )
        for one, next_one in zip(before.ahead, after.ahead, strict=True)
    )
