"""Recorded traces for an emulated sensor: one joint of a BVH recording, or a CSV with orientations."""

from __future__ import annotations

import csv
from math import isfinite, sqrt
from pathlib import Path

from hw_sim.motions import Motion, Quaternion, trace

TIME_COLUMNS = ("time_s", "sampled_s", "sent_s", "t")


class TraceError(ValueError):
    """A trace that cannot be played: the file, the line where there is one, what is wrong, what to do."""


def read_trace(path: Path | None, joint: str | None = None) -> Motion:
    """The motion in a file: `.bvh` with the name of a joint, else CSV with a header (see read_csv).

    Raises TraceError, also when there is no file or no joint; OSError when the file cannot be read.
    """
    if path is None:
        raise TraceError("which recording? Give a BVH or CSV file with --trace")
    if path.suffix.lower() == ".bvh":
        if joint is None:
            raise TraceError(f"{path}: which joint? Give its name with --joint")
        return read_bvh_joint(path, joint)
    return read_csv(path)


def read_bvh_joint(path: Path, joint: str) -> Motion:
    """How one joint of a recording turns against its parent."""
    from appliance.pose.bvh import BvhError, read_bvh
    from appliance.pose.skeleton import UnknownJointError

    try:
        recording = read_bvh(path)
        index = recording.skeleton.index(joint)
    except (BvhError, UnknownJointError) as error:
        raise TraceError(f"{path}: {error}" if isinstance(error, UnknownJointError) else str(error)) from None
    orientations: list[Quaternion] = [
        (float(w), float(x), float(y), float(z)) for w, x, y, z in recording.poses[:, index]
    ]
    return _motion(path, [frame / recording.fps for frame in range(len(orientations))], orientations)


def read_csv(path: Path) -> Motion:
    """Columns w, x, y, z and one of time_s, sampled_s, sent_s, t: also what `bunraku emulate --log` wrote."""
    times_s: list[float] = []
    orientations: list[Quaternion] = []
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        rows = csv.DictReader(file)
        columns = rows.fieldnames or []
        time_column = next((name for name in TIME_COLUMNS if name in columns), None)
        if time_column is None or not {"w", "x", "y", "z"} <= set(columns):
            raise TraceError(f"{path}:1: a trace needs a header with the columns time_s, w, x, y, z")
        for row in rows:
            try:
                time_s, w, x, y, z = (float(row[name]) for name in (time_column, "w", "x", "y", "z"))
            except (TypeError, ValueError):
                raise TraceError(
                    f"{path}:{rows.line_num}: time and orientation should be five numbers"
                ) from None
            norm = sqrt(w * w + x * x + y * y + z * z)
            if not (isfinite(time_s) and isfinite(norm) and norm > 0.5):
                raise TraceError(
                    f"{path}:{rows.line_num}: this is no orientation: {w:g}, {x:g}, {y:g}, {z:g}"
                )
            times_s.append(time_s)
            orientations.append((w / norm, x / norm, y / norm, z / norm))
    return _motion(path, times_s, orientations)


def _motion(path: Path, times_s: list[float], orientations: list[Quaternion]) -> Motion:
    try:
        return trace(times_s, orientations)
    except ValueError as error:
        raise TraceError(f"{path}: {error}") from None
