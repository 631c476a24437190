"""Recordings as tables: NPZ for numpy, CSV for everything else, both in metres and with their skeleton."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

MARK = "# bunraku recording: "  # the first line of a CSV: the skeleton and the rate as JSON


def write_npz(path: Path, recording: Recording) -> None:
    """poses (N, J, 4), roots (N, 3), fps, names (J), parents (J), offsets (J, 3), end_joints (E),
    end_offsets (E, 3), and translations (N, J, 3) where bones change their length."""
    figure = recording.skeleton
    arrays: dict[str, Any] = {
        "poses": recording.poses,
        "roots": recording.roots,
        "fps": np.float64(recording.fps),
        "names": np.array(figure.names),
        "parents": np.array(figure.parents, dtype=np.int64),
        "offsets": np.asarray(figure.offsets, dtype=np.float64),
        "end_joints": np.array([joint for joint, _ in figure.ends], dtype=np.int64),
        "end_offsets": np.array([offset for _, offset in figure.ends], dtype=np.float64).reshape(-1, 3),
    }
    if recording.translations is not None:
        arrays["translations"] = recording.translations
    np.savez_compressed(path, **arrays)


def write_csv(path: Path, recording: Recording) -> None:
    """The skeleton in a comment, a line of column names, then a row for each frame.

    time in seconds, root.x .y .z in metres, NAME.w .x .y .z of each joint; NAME.tx .ty .tz in metres where
    bones change their length.
    """
    count = len(recording)
    parts = [np.arange(count)[:, None] / recording.fps, recording.roots, recording.poses.reshape(count, -1)]
    if recording.translations is not None:
        parts.append(recording.translations.reshape(count, -1))
    table = np.concatenate(parts, axis=1)
    columns = columns_of(recording.skeleton.names, recording.translations is not None)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(MARK + json.dumps(facts_of(recording.skeleton, recording.fps)) + "\n")
        csv.writer(file, lineterminator="\n").writerow(columns)
        np.savetxt(file, table, fmt="%.10g", delimiter=",")


def columns_of(names: Sequence[str], stretched: bool) -> list[str]:
    """Columns of a CSV; stretched: with the translations of bones that change their length."""
    columns = ["time", "root.x", "root.y", "root.z"]
    columns += [f"{name}.{part}" for name in names for part in "wxyz"]
    return columns + [f"{name}.t{part}" for name in names for part in "xyz"] if stretched else columns


def facts_of(skeleton: Skeleton, fps: float) -> dict[str, Any]:
    """A skeleton and a rate as plain values, for JSON."""
    return {
        "fps": fps,
        "names": list(skeleton.names),
        "parents": [int(parent) for parent in skeleton.parents],
        "offsets": np.asarray(skeleton.offsets, float).tolist(),
        "ends": [[int(joint), [float(part) for part in offset]] for joint, offset in skeleton.ends],
    }
