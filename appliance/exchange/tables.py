"""Recordings as tables: NPZ for numpy, CSV for everything else, both in metres and with their skeleton."""

from __future__ import annotations

import csv
import json
import zipfile
import zlib
from collections.abc import Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.figure_facts import MAX_VALUES, checked_recording, checked_skeleton, facts_of
from appliance.pose.foreign_file import opened, plain_json
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording

MARK = "# bunraku recording: "  # the first line of a CSV: the skeleton and the rate as JSON
_LONGEST_LINE = 1 << 20
_NEEDED = ("poses", "roots", "fps", "names", "parents", "offsets")


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


def read_npz(path: Path) -> Recording:
    """A recording as `write_npz` writes it. Raises ExchangeError or OSError."""
    try:
        with opened(path) as stream, zipfile.ZipFile(stream) as archive:
            if sum(member.file_size for member in archive.infolist()) > 2 * 8 * MAX_VALUES:
                raise ExchangeError(path, f"It holds more than {MAX_VALUES} numbers. Cut the recording.")
            stream.seek(0)
            with np.load(stream, allow_pickle=False) as loaded:
                arrays = {name: loaded[name] for name in loaded.files}
    except ExchangeError:
        raise
    except (
        ValueError,
        EOFError,
        KeyError,
        zipfile.BadZipFile,
        zlib.error,
        RuntimeError,
        MemoryError,
    ) as error:
        raise ExchangeError(path, f"This is no NPZ file of numbers ({error}).") from error
    missing = [name for name in _NEEDED if name not in arrays]
    if missing:
        raise ExchangeError(path, f"{', '.join(missing)} missing. An NPZ recording has {', '.join(_NEEDED)}.")
    try:
        numbers = {name: np.asarray(arrays[name], dtype=np.float64) for name in arrays if name != "names"}
        joints = arrays.get("end_joints", np.empty(0, np.int64)).astype(np.int64).tolist()
        ends = list(zip(joints, numbers.get("end_offsets", np.empty((0, 3))).tolist(), strict=True))
        names = [str(name) for name in arrays["names"].tolist()]
        parents = [int(parent) for parent in arrays["parents"].tolist()]
        fps = float(numbers["fps"])
    except (ValueError, TypeError) as error:
        raise ExchangeError(path, f"An array has another kind or shape than it should ({error}).") from error
    skeleton = checked_skeleton(path, names, parents, numbers["offsets"], ends)
    return checked_recording(
        path, skeleton, numbers["poses"], numbers["roots"], fps, numbers.get("translations")
    )


def _columns(names: Sequence[str], stretched: bool) -> list[str]:
    """Of a CSV; stretched: with the translations of bones that change their length."""
    columns = ["time", "root.x", "root.y", "root.z"]
    columns += [f"{name}.{part}" for name in names for part in "wxyz"]
    return columns + [f"{name}.t{part}" for name in names for part in "xyz"] if stretched else columns


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
    columns = _columns(recording.skeleton.names, recording.translations is not None)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(MARK + json.dumps(facts_of(recording.skeleton, recording.fps)) + "\n")
        csv.writer(file, lineterminator="\n").writerow(columns)
        np.savetxt(file, table, fmt="%.10g", delimiter=",")


def read_csv(path: Path) -> Recording:
    """A recording as `write_csv` writes it. Raises ExchangeError with the line, or OSError."""
    with TextIOWrapper(opened(path), encoding="utf-8-sig", errors="replace") as file:
        head = file.readline(_LONGEST_LINE)
        if not head.startswith(MARK):
            raise ExchangeError(
                path,
                f"The first line does not begin with '{MARK.strip()}', so that nothing says what the bones "
                "are. For positions of points use `bunraku import`.",
                1,
            )
        try:
            facts = plain_json(head[len(MARK) :])
            offsets = np.asarray(facts["offsets"], dtype=np.float64)
            names = [str(name) for name in facts["names"]]
            parents = [int(parent) for parent in facts["parents"]]
            ends, fps = [(int(joint), offset) for joint, offset in facts["ends"]], float(facts["fps"])
        except (ValueError, LookupError, TypeError) as error:
            raise ExchangeError(path, f"The skeleton in it cannot be read ({error}).", 1) from error
        skeleton = checked_skeleton(path, names, parents, offsets, ends, 1)
        header = next(csv.reader([file.readline(_LONGEST_LINE)]), [])
        plain, stretched = (_columns(names, each) for each in (False, True))
        if header not in (plain, stretched):
            wrong = next(
                (c for c, e in zip(header, stretched, strict=False) if c != e), "too few or too many"
            )
            raise ExchangeError(path, f"The columns are not those of the skeleton ({wrong}).", 2)
        table = read_rows(path, file, len(header), 3)
    count, joints = len(table), len(names)
    poses = table[:, 4 : 4 + 4 * joints].reshape(count, joints, 4)
    translations = table[:, 4 + 4 * joints :].reshape(count, joints, 3) if header == stretched else None
    return checked_recording(path, skeleton, poses, table[:, 1:4], fps, translations, first_line=3)


def read_rows(path: Path, file: TextIOWrapper, columns: int, first: int, gaps: bool = False) -> Array:
    """Rows of numbers (N, columns) from line `first` on. gaps: an empty field becomes NaN.

    Raises ExchangeError with the line.
    """
    rows: list[Array] = []
    for line, text in enumerate(iter(lambda: file.readline(_LONGEST_LINE), ""), first):
        words = text.strip().split(",")
        if words == [""]:
            raise ExchangeError(path, "This line is empty. Remove it.", line)
        if len(words) != columns:
            raise ExchangeError(path, f"This line has {len(words)} values, the others {columns}.", line)
        try:
            rows.append(np.array([word.strip() or "nan" for word in words] if gaps else words, np.float64))
        except ValueError as error:
            raise ExchangeError(path, f"{str(error).capitalize()}.", line) from error
        if len(rows) * columns > MAX_VALUES:
            raise ExchangeError(path, f"It holds more than {MAX_VALUES} numbers. Cut it.", line)
    if not rows:
        raise ExchangeError(path, "There are no frames.", first)
    return np.stack(rows)
