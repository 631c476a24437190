"""Skeletons as plain values, and a check of the arrays that a foreign file gives for a dance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from appliance.exchange.exchange_error import ExchangeError
from appliance.pose import quaternion
from appliance.pose.kept_rows import KeptRows
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

MAX_VALUES = 50_000_000  # numbers in a recording, as for BVH
UNIT_TOLERANCE = 0.01  # how far the length of a quaternion may be from 1


def checked_skeleton(
    path: Path,
    names: Sequence[str],
    parents: Sequence[int],
    offsets: Array,
    ends: Sequence[tuple[int, Sequence[float]]] = (),
    line: int = 0,
) -> Skeleton:
    """A skeleton of these values. Raises ExchangeError where they are invalid."""

    def fail(message: str) -> ExchangeError:
        return ExchangeError(path, message, line)

    count = len(names)
    if not count or len(parents) != count or offsets.shape != (count, 3):
        raise fail(
            f"{count} names, {len(parents)} parents and offsets of shape {offsets.shape} do not belong "
            "together: names (J), parents (J) and offsets (J, 3) must have the same J."
        )
    if len(set(names)) != count:
        twice = next(name for name in names if list(names).count(name) > 1)
        raise fail(f"Two joints are called '{twice}'. Rename one.")
    if parents[0] != -1 or any(not 0 <= parent < joint for joint, parent in enumerate(parents) if joint):
        raise fail(
            "The first joint must be the root (parent -1), and each parent must come before its child."
        )
    if not np.isfinite(offsets).all():
        raise fail("An offset is not finite (NaN or infinite).")
    found: list[tuple[int, tuple[float, float, float]]] = []
    for joint, offset in ends:
        if not 0 <= joint < count or len(offset) != 3 or not all(map(math.isfinite, offset)):
            raise fail("An end does not name a joint and three finite numbers.")
        x, y, z = map(float, offset)
        found.append((int(joint), (x, y, z)))
    fixed = np.array(offsets, dtype=np.float64)
    fixed[0] = 0.0
    return Skeleton(tuple(names), tuple(int(parent) for parent in parents), fixed, tuple(found))


def checked_recording(
    path: Path,
    skeleton: Skeleton,
    poses: Array,
    roots: Array,
    fps: float,
    translations: Array | None = None,
    rows: KeptRows | None = None,
    notes: Sequence[str] = (),
) -> Recording:
    """A recording of these arrays. rows: of the file, where some are lost already; notes: what else to say.

    Frames whose values are no rotations or places are lost, and the notes say which. Raises ExchangeError
    where shapes differ or no frame is left.
    """
    joints = len(skeleton)
    if poses.ndim != 3 or poses.shape[1:] != (joints, 4) or roots.shape != (len(poses), 3):
        raise ExchangeError(
            path,
            f"poses {poses.shape} and roots {roots.shape} do not belong together: with {joints} joints they "
            f"must be (N, {joints}, 4) and (N, 3).",
        )
    if translations is not None and translations.shape != (len(poses), joints, 3):
        raise ExchangeError(path, f"translations {translations.shape} must be (N, {joints}, 3).")
    if not len(poses):
        raise ExchangeError(path, "There are no frames. Export the recording again.")
    if not (math.isfinite(fps) and 0.0 < fps <= 10_000.0):
        raise ExchangeError(path, f"{fps:g} frames a second is no rate.")
    count = range(len(poses))
    rows = rows or KeptRows("frame", [*count], [*count])
    lengths = np.linalg.norm(poses, axis=-1)
    sound = np.isfinite(roots).all(axis=1) & (np.abs(lengths - 1.0) < UNIT_TOLERANCE).all(axis=1)
    if translations is not None:
        sound &= np.isfinite(translations).all(axis=(1, 2))
    if not sound.all():
        frame = int(np.argmin(sound))
        wrong = np.flatnonzero(~(np.abs(lengths[frame] - 1.0) < UNIT_TOLERANCE))
        what = f"the rotation of '{skeleton.names[wrong[0]]}' is no unit quaternion" if len(wrong) else ""
        why = f"{what or 'a position is not finite'}. Rotations are w, x, y, z of length 1."
        if not sound.any():
            line = rows.places[frame] if rows.unit == "line" else 0
            raise ExchangeError(path, f"Frame {rows.numbers[frame]}: {why}", line)
        rows = rows.without(np.flatnonzero(~sound).tolist(), what or "a position is not finite")
    moved = None if translations is None else translations[sound].astype(np.float64)
    turned = quaternion.continuous(quaternion.normalize(poses[sound].astype(np.float64)))
    said = (*notes, *rows.notes())
    kept = Recording(skeleton, turned, roots[sound].astype(np.float64), fps, moved, said)
    return kept.spread(np.array(rows.numbers))
