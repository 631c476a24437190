"""Landmarks repaired: sides that changed places, leaps, gaps, uneven times, jitter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from appliance.pose.point_fit import TRUNK
from appliance.pose.quaternion import Array
from appliance.studio.exchange.fitting import gaps_of

FPS = 50.0
_GUESSED_S = 2.0  # a limb that is hidden for so long is nearer to a network's guess than to a straight line
LEAST_SEEN = 0.3  # a network's own doubt: below it the place is a guess
_LEAP = 0.12  # fraction of the figure's height: a landmark this far from its neighbours in time leapt
_LEAP_FRAMES = 3  # neighbours on each side
_SWAP_COST = 0.5  # fraction of the figure's height that a change of sides has to save
_LIMBS = (("shoulder", "elbow", "wrist", "index", "little", "thumb", "hand"), ("hip", "knee", "ankle", "toe"))
# The One-Euro filter (Casiez 2012), there and back, so that it does not lag. Tried on made landmarks of four
# dances with 1 to 3 cm of noise: less smoothing leaves jitter, more rounds off quick arms.
_SLOWEST_HZ, _BETA, _SPEED_HZ = 0.7, 4.0, 2.0
_STEADY_S = 0.12  # standard deviation of the filter of short bones


@dataclass
class Repaired:
    """points (N, P, 3) at FPS, no gap in them; what was done, in numbers."""

    points: Array
    swapped: int = 0
    leaps: int = 0
    gaps: list[tuple[int, float, float]] = field(default_factory=list)  # landmark, from, to; seconds


def repaired(
    parts: Sequence[str],
    points: Array,
    seen: Array,
    times: NDArray[np.float64],
    longest_gap_s: float,
    smooths: bool = True,
) -> Repaired:
    """Landmarks (N, P, 3) of these parts at uneven times -> at an even rate.

    seen (N, P): 0..1. Gaps up to longest_gap_s are crossed in straight lines. In longer ones a landmark is
    where the network guessed it, from _GUESSED_S on; else they are crossed too. They are listed.
    """
    found, rate = points.copy(), 1.0 / float(np.median(np.diff(times))) if len(times) > 1 else FPS
    trunk = [part in TRUNK for part in parts]
    found[(seen < LEAST_SEEN) & ~np.array(trunk)] = np.nan
    hidden = [one for one in gaps_of(found) if (one.last - one.first + 1) / rate > longest_gap_s]
    for gap in hidden:
        if (gap.last - gap.first + 1) / rate > _GUESSED_S:
            found[gap.first : gap.last + 1, gap.joint] = points[gap.first : gap.last + 1, gap.joint]
    size = _height(found)
    found, swapped = _sides_put_back(parts, found, size)
    leaps = _leaps(found, size)
    found[leaps] = np.nan
    gaps = [
        (gap.joint, float(times[gap.first]), float(times[gap.last])) for gap in hidden if parts[gap.joint]
    ]
    even = evenly(found, times)
    if smooths:
        even = (smoothed(even, size) + smoothed(even[::-1], size)[::-1]) / 2
        _steady_short_bones(parts, even)
    return Repaired(even, swapped, int(leaps.sum()), gaps)


def evenly(points: Array, times: NDArray[np.float64]) -> Array:
    """Points (N, P, 3) at FPS, straight between the frames in which they were seen; one never seen: NaN."""
    at = np.arange(times[0], times[-1] + 1e-9, 1.0 / FPS)
    found = np.full((len(at), *points.shape[1:]), np.nan)
    for place in range(points.shape[1]):
        is_seen = ~np.isnan(points[:, place, :2]).any(axis=1)
        if is_seen.any():
            for axis in range(3):
                found[:, place, axis] = np.interp(at, times[is_seen], points[is_seen, place, axis])
    return found


def smoothed(points: Array, size: float) -> Array:
    """The One-Euro filter over frames at FPS: slow landmarks are smoothed, quick ones followed."""
    out = points.copy()
    speed = np.zeros_like(points[0])
    for frame in range(1, len(points)):
        raw = (points[frame] - points[frame - 1]) * FPS / size
        speed += _share(_SPEED_HZ) * (raw - speed)
        cutoff = _SLOWEST_HZ + _BETA * np.linalg.norm(speed, axis=-1, keepdims=True)
        out[frame] = out[frame - 1] + _share(cutoff) * (points[frame] - out[frame - 1])
    return out


def _steady_short_bones(parts: Sequence[str], points: Array) -> None:
    """Toes against their ankle, and the face against the shoulders: short bones, which noise turns far."""
    at = {part: place for place, part in enumerate(parts) if part}
    reach = np.arange(-round(3 * _STEADY_S * FPS), round(3 * _STEADY_S * FPS) + 1)
    kernel = np.exp(-0.5 * (reach / (_STEADY_S * FPS)) ** 2)
    for part, place in at.items():
        side, _, name = part.rpartition(" ")
        if name == "toe":
            start = points[:, at[f"{side} ankle"]]
        elif name in ("nose", "eye", "ear", "head"):
            start = (points[:, at["left shoulder"]] + points[:, at["right shoulder"]]) / 2
        else:
            continue
        padded = np.pad(points[:, place] - start, ((len(reach) // 2,) * 2, (0, 0)), mode="edge")
        for axis in range(3):
            smooth = np.convolve(padded[:, axis], kernel / kernel.sum(), mode="valid")
            points[:, place, axis] = start[:, axis] + smooth


def _share(cutoff_hz: Array | float) -> Array | float:
    """How much of the new value a first-order low-pass takes."""
    turns = 2.0 * np.pi * cutoff_hz / FPS
    return turns / (turns + 1.0)


def _height(points: Array) -> float:
    """A figure's usual extent, in the points' unit."""
    whole = points[~np.isnan(points).all(axis=(1, 2))]
    extent = np.nanmax(whole, axis=1) - np.nanmin(whole, axis=1)
    return max(float(np.percentile(np.linalg.norm(extent[:, :2], axis=-1), 75)), 1e-9)


def _leaps(points: Array, size: float) -> NDArray[np.bool_]:
    """(N, P): landmarks that are far from the median of their neighbours in time."""
    padded = np.pad(points, ((_LEAP_FRAMES, _LEAP_FRAMES), (0, 0), (0, 0)), mode="edge")
    windows = np.stack([padded[shift : shift + len(points)] for shift in range(2 * _LEAP_FRAMES + 1)])
    with np.errstate(invalid="ignore"):
        middle = _nanmedian(windows)
        off = np.linalg.norm(points - middle, axis=-1)
        spread = _nanmedian(np.linalg.norm(windows - middle, axis=-1))
        return np.asarray(off > np.maximum(_LEAP * size, 3.0 * spread))


def _nanmedian(values: Array) -> Array:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a landmark that nobody sees has no median
        found: Array = np.nanmedian(values, axis=0)
    return found


def _sides_put_back(parts: Sequence[str], points: Array, size: float) -> tuple[Array, int]:
    """Left and right of arms and of legs where a network mixed them up; in how many frames.

    The cheapest way through the frames (Viterbi): a step costs how far the landmarks of a pair of limbs move,
    a change of sides its own cost. Which of the two ways is right is what most frames say.
    """
    found, frames = points.copy(), np.zeros(len(points), dtype=bool)
    for limb in _LIMBS:
        pairs = [
            (parts.index(f"left {part}"), parts.index(f"right {part}"))
            for part in limb
            if f"left {part}" in parts and f"right {part}" in parts
        ]
        if pairs:
            left, right = (list(side) for side in zip(*pairs, strict=True))
            is_swapped = _swapped(found[:, left], found[:, right], _SWAP_COST * size)
            found[np.ix_(is_swapped, left)], found[np.ix_(is_swapped, right)] = (
                found[np.ix_(is_swapped, right)],
                found[np.ix_(is_swapped, left)],
            )
            frames |= is_swapped
    return found, int(frames.sum())


def _swapped(left: Array, right: Array, change: float) -> NDArray[np.bool_]:
    """(N,): frames in which left (N, L, 3) and right are each other's."""
    kept, crossed = _steps(left, right), _steps(left, right, crosses=True)
    cost, way = np.zeros(2), np.zeros((len(left), 2), dtype=int)
    for frame in range(1, len(left)):
        stay, turn = cost + kept[frame - 1], cost[::-1] + crossed[frame - 1] + change
        way[frame] = np.where(stay <= turn, (0, 1), (1, 0))
        cost = np.minimum(stay, turn)
    states = np.zeros(len(left), dtype=bool)
    state = int(cost.argmin())
    for frame in range(len(left) - 1, -1, -1):
        states[frame] = bool(state)
        state = int(way[frame, state])
    return ~states if states.mean() > 0.5 else states


def _steps(left: Array, right: Array, crosses: bool = False) -> NDArray[np.float64]:
    """(N - 1,): how far both sides move from frame to frame, as they are called or crosswise."""
    after_left, after_right = (right, left) if crosses else (left, right)
    moved = np.linalg.norm(
        np.concatenate([after_left[1:] - left[:-1], after_right[1:] - right[:-1]], axis=1), axis=-1
    )
    return np.asarray(np.nansum(moved, axis=1))
