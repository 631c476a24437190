"""A run in numbers: pure functions of the packets sent and received."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hw_sim.sound_card import Played

_FEWEST, _GRID_S, _LONGEST_LAG_S, _SMOOTH_S = 50, 0.002, 0.3, 0.08  # for `lag_ms`
_ALIKE = 0.5  # correlation at least: arms go only where arms can, so a joint is 0.7 to 0.8 like its hand
Floats = NDArray[np.float64]

BEFORE_STEP_S = 0.1  # the joint's orientation before a step is its mean over this long
SETTLED_S = (0.3, 0.45)  # and after it over this part
HEARD_WITHIN_S = 0.1
_LOUD_WINDOW_S, _HEARD = 0.001, 1e-4  # share of full scale below which nothing is audible


class SentReading(NamedTuple):
    """A reading as the emulator's log has it; times in monotonic seconds."""

    sequence: int
    sent_at: float
    sampled_at: float
    orientation: tuple[float, float, float, float]
    power_on_at: float = 0.0  # start of the sensor's boot that made it


class Frame(NamedTuple):
    """A frame as the receiver has it. `joint` is the held joint's local rotation (4,), w, x, y, z."""

    arrived_at: float
    tick: int
    sensor_sequence: int
    late: bool
    joint: Floats


class Restart(NamedTuple):
    """The box killed and restarted while a sensor keeps running; monotonic seconds."""

    killed_at: float
    started_at: float
    used_at: float  # the first frame of the new box that carries a reading


class Transport(NamedTuple):
    """Each reading's transport: when it was sent (s), how long until a frame used it (ms)."""

    sent_at: Floats
    latency_ms: Floats
    overtaken: int  # among them, readings that no frame carries: a newer one came before the next tick


def transport(readings: Sequence[SentReading], frames: Sequence[Frame]) -> Transport:
    """Datagram in to datagram out: from a reading's sending to the first frame that knows it.

    A reading that came too late for its tick and was overtaken by the next one counts with the frame that
    carries the newer one: leaving it out would flatter the slow ones.
    """
    sent: dict[int, float] = {}
    for reading in readings:
        sent.setdefault(reading.sequence, reading.sent_at)
    in_order = sorted(frames, key=lambda frame: frame.arrived_at)
    newest = np.maximum.accumulate([frame.sensor_sequence for frame in in_order] or [-1])
    arrived_at = [frame.arrived_at for frame in in_order]
    times, latencies = [], []
    for number, at in sent.items():
        first = int(np.searchsorted(newest, number))
        if first < len(in_order) and arrived_at[first] >= at:
            times.append(at)
            latencies.append(1000.0 * (arrived_at[first] - at))
    carried = {frame.sensor_sequence for frame in frames}
    overtaken = sum(number <= int(newest[-1]) and number not in carried for number in sent)
    return Transport(np.array(times), np.array(latencies), overtaken)


def power_on_s(readings: Sequence[SentReading], frames: Sequence[Frame]) -> Floats:
    """From each power-on of the sensor to the first frame that carries a reading of that power-on, seconds.

    A power-on of which no frame tells is left out: the run ended before, or the box did not take the sensor.
    """
    in_order = sorted(frames, key=lambda frame: frame.arrived_at)
    arrived_at = [frame.arrived_at for frame in in_order]
    found = []
    for power_on_at in sorted({reading.power_on_at for reading in readings}):
        sent = {r.sequence: r.sent_at for r in readings if r.power_on_at == power_on_at}
        first = int(np.searchsorted(arrived_at, min(sent.values())))
        before = in_order[first - 1].sensor_sequence if first else -1
        for frame in in_order[first:]:
            # A frame shows the newest reading of the power-on before until there is a newer one.
            if frame.sensor_sequence != before:
                if sent.get(frame.sensor_sequence, np.inf) <= frame.arrived_at:
                    found.append(frame.arrived_at - power_on_at)
                break
    return np.array(found)


def missing_frames(frames: Sequence[Frame]) -> int:
    """Ticks between the first and the last frame of which no frame arrived: skipped or lost."""
    ticks = {frame.tick for frame in frames}
    return max(ticks) - min(ticks) + 1 - len(ticks) if ticks else 0


def steps(readings: Sequence[SentReading]) -> list[float]:
    """The moments (s) at which the sensor's orientation jumped."""
    in_order = sorted({reading.sequence: reading for reading in readings}.values())
    return [
        after.sampled_at
        for before, after in pairwise(in_order)
        if abs(float(np.dot(before.orientation, after.orientation))) < 0.9999
    ]


class Shown(Protocol):
    """Something that shows the held joint: a frame in a datagram, a picture on a screen."""

    @property
    def arrived_at(self) -> float: ...
    @property
    def joint(self) -> Floats: ...


def watched_steps(step_times: Sequence[float], shown: Sequence[Shown]) -> int:
    """How many steps of the sensor fell into the time that was watched: those that should show."""
    times = np.array([one.arrived_at for one in shown])
    return sum(min(int(part.sum()) for part in _around(moment, times)) >= 2 for moment in step_times)


def response_ms(step_times: Sequence[float], shown: Sequence[Shown]) -> Floats:
    """From each step of the sensor to half of the step in what is shown, ms; only steps that show.

    The way from the orientation before to that after is a line; each frame's place on it is the part of its
    rotation that lies along it. Between two frames the joint is taken to stand as in the earlier one.
    """
    times = np.array([one.arrived_at for one in shown])
    if not len(times):
        return times
    joints = _continuous(np.array([one.joint for one in shown]))
    found = []
    for moment in step_times:
        before, after = _around(moment, times)
        if before.sum() < 2 or after.sum() < 2:
            continue
        start, end = joints[before].mean(0), joints[after].mean(0)
        way = end - start
        noise = max(joints[before].std(0).max(), joints[after].std(0).max())
        if np.linalg.norm(way) < 0.02 or noise > 0.2 * np.linalg.norm(way):
            continue
        during = (times >= moment) & (times < moment + SETTLED_S[0])
        share = (joints[during] - start) @ way / (way @ way)
        beyond = np.flatnonzero(share >= 0.5)
        if len(beyond):
            found.append(1000.0 * (times[during][beyond[0]] - moment))
    return np.array(found)


def _around(moment: float, times: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of the times are just before a step, and which after it, when it should have settled."""
    before = (times >= moment - BEFORE_STEP_S) & (times < moment)
    return before, (times >= moment + SETTLED_S[0]) & (times < moment + SETTLED_S[1])


def sounded_ms(moments: Sequence[float], played: Played) -> Floats:
    """From each moment to the first audible change of what a card plays, ms; only those with a change.

    A change: within HEARD_WITHIN_S the loudness in windows of 1 ms is three times what it was at most in the
    tenth of a second before. It begins with the first window that is half louder than that.
    """
    size = max(1, round(_LOUD_WINDOW_S / float(np.median(np.diff(played.at))))) if len(played.at) > 1 else 1
    count = len(played.at) // size
    times = played.at[: count * size : size]
    loud = np.sqrt((played.samples[: count * size].reshape(count, size) ** 2).mean(axis=1))
    found = []
    for moment in moments:
        begin, middle, end = np.searchsorted(times, [moment - BEFORE_STEP_S, moment, moment + HEARD_WITHIN_S])
        if not begin < middle < end < len(times):
            continue
        before = max(float(loud[begin:middle].max()), _HEARD)
        if np.percentile(loud[middle:end], 90) >= 3.0 * before:
            found.append(1000.0 * (times[middle:end][loud[middle:end] >= 1.5 * before][0] - moment))
    return np.array(found)


def lag_ms(readings: Sequence[SentReading], shown: Sequence[Shown]) -> float | None:
    """How late what is shown follows a hand that dances, ms; None: it does not follow.

    The shift at which the hand's turning speed and that of the shown joint are most alike (the greatest
    correlation; neutral pose and mounting do not matter to it).
    """
    sent = sorted({reading.sequence: reading for reading in readings}.values())
    hand = [(reading.sampled_at, reading.orientation) for reading in sent]
    seen = [(one.arrived_at, tuple(one.joint)) for one in shown]
    if min(len(hand), len(seen)) < _FEWEST:
        return None
    begin, end = max(hand[0][0], seen[0][0]), min(hand[-1][0], seen[-1][0]) - _LONGEST_LAG_S
    grid = np.arange(begin, end, _GRID_S)
    if len(grid) < _FEWEST:
        return None
    wanted = _speeds(hand, grid)
    lags = np.arange(0.0, _LONGEST_LAG_S, _GRID_S)
    alike = np.array([np.corrcoef(wanted, _speeds(seen, grid + lag))[0, 1] for lag in lags])
    best = int(np.argmax(alike))
    if not 0 < best < len(lags) - 1 or alike[best] < _ALIKE:
        return None
    before, peak, after = alike[best - 1 : best + 2]
    return float(1000.0 * (lags[best] + _GRID_S * 0.5 * (before - after) / (before - 2.0 * peak + after)))


def _speeds(turned: Sequence[tuple[float, Sequence[float]]], grid: Floats) -> Floats:
    """Degrees a second at times (N,) of an orientation at its own times: smoothed over _SMOOTH_S."""
    times = np.array([at for at, _ in turned])
    rotations = _continuous(np.array([rotation for _, rotation in turned]))
    first, last = grid - _SMOOTH_S / 2.0, grid + _SMOOTH_S / 2.0
    here = [np.stack([np.interp(at, times, part) for part in rotations.T], -1) for at in (first, last)]
    steps = np.linalg.norm(here[1] - here[0], axis=-1)
    speeds: Floats = np.degrees(2.0 * steps) / _SMOOTH_S
    return speeds


def percentiles(values: Floats, which: Mapping[str, float], missing: int = 0) -> dict[str, float | None]:
    """Named percentiles, rounded to microseconds of the given milliseconds; None without values.

    missing: how many more should have come and never did. They count as later than all others: a percentile
    that is one of them is None.
    """
    ranks = {name: share / 100.0 * (len(values) + missing - 1) for name, share in which.items()}
    places, in_order = np.arange(len(values)), np.sort(values)
    return {
        name: round(float(np.interp(rank, places, in_order)), 3) if np.ceil(rank) < len(values) else None
        for name, rank in ranks.items()
    }


def _continuous(quaternions: Floats) -> Floats:
    """The same rotations without sign jumps."""
    signs = np.sign(np.einsum("nk,nk->n", quaternions[1:], quaternions[:-1]))
    signs[signs == 0] = 1.0
    result: Floats = quaternions.copy()
    result[1:] *= np.cumprod(signs)[:, None]
    return result
