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
from appliance.pose.foreign_file import opened, opened_text, plain_json
from appliance.pose.kept_rows import KeptRows
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording

MARK = "# bunraku recording: "  # the first line of a CSV: the skeleton and the rate as JSON
_LONGEST_LINE = 1 << 20
_SHOWN = 6
_NONE = ("", "na", "n/a", "#n/a", "nan", "null", "none", "-", "--", ".")  # fields without a value
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


def read_npz(path: Path, true_fps: float | None = None) -> Recording:
    """A recording as `write_npz` writes it; true_fps: in place of its rate. Raises ExchangeError, OSError."""
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
    if true_fps is not None:
        arrays["fps"] = np.float64(true_fps)
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
    """Columns of a CSV; stretched: with the translations of bones that change their length."""
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


def read_csv(path: Path, true_fps: float | None = None) -> Recording:
    """A recording as `write_csv` writes it, or as a spreadsheet saves that; true_fps: in place of its rate.

    Columns are found by their names. Raises ExchangeError with the line, or OSError.
    """
    with opened_text(path) as file:
        head = file.readline(_LONGEST_LINE)
        if head.startswith(f'"{MARK}'):  # a spreadsheet puts the field in quotes
            head = next(csv.reader([head])).pop(0).rstrip(";,\t\n ")
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
            ends = [(int(joint), offset) for joint, offset in facts["ends"]]
            fps = true_fps or float(facts["fps"])
        except (ValueError, LookupError, TypeError) as error:
            raise ExchangeError(path, f"The skeleton in it cannot be read ({error}).", 1) from error
        skeleton = checked_skeleton(path, names, parents, offsets, ends, 1)
        titles = file.readline(_LONGEST_LINE)
        separator = separator_of(titles)
        header = [title.strip() for title in next(csv.reader([titles], delimiter=separator), [])]
        stretched = f"{names[0]}.tx" in header
        wanted = _columns(names, stretched)[1:]
        missing = [column for column in wanted if column not in header]
        if missing:
            raise ExchangeError(path, f"Columns of the skeleton are missing: {_some(missing)}.", 2)
        values, rows = read_rows(path, file, separator, len(header), 3)
    table = values[:, [header.index(column) for column in wanted]]
    others = [column or "one without a title" for column in header if column not in (*wanted, "time")]
    notes = [f"columns that are none of the skeleton left out: {_some(others)}"] if others else []
    count, joints = len(table), len(names)
    poses = table[:, 3 : 3 + 4 * joints].reshape(count, joints, 4)
    translations = table[:, 3 + 4 * joints :].reshape(count, joints, 3) if stretched else None
    return checked_recording(path, skeleton, poses, table[:, :3], fps, translations, rows, notes)


def _some(columns: Sequence[str]) -> str:
    return ", ".join(columns[:_SHOWN]) + (f" and {len(columns) - _SHOWN} more" if columns[_SHOWN:] else "")


def separator_of(line: str) -> str:
    """The delimiter of a table: if there is a semicolon or a tab, a comma is a decimal point."""
    return next((mark for mark in (";", "\t", ",") if mark in line), ",")


def read_rows(
    path: Path, file: TextIOWrapper, separator: str, columns: int, first: int
) -> tuple[Array, KeptRows]:
    """Rows of numbers (N, columns) from line `first` on, NaN where a field is empty or says NA.

    Decimal commas are read; empty lines and comments are no rows; rows with another number of fields, or with
    words, are lost. Raises ExchangeError with the line where no row is left.
    """
    found: list[Array] = []
    rows = KeptRows()
    wrong: tuple[int, str] | None = None
    for line, text in enumerate(iter(lambda: file.readline(_LONGEST_LINE), ""), first):
        if not text.strip(f'{separator} \r\n"') or text.startswith("#"):
            continue
        try:
            found.append(_numbers(text, separator, columns))
            rows.keep(line)
        except ValueError as error:
            wrong = wrong or (line, str(error))
            rows.lose(line, str(error))
        if rows.count * columns > MAX_VALUES:
            raise ExchangeError(path, f"It holds more than {MAX_VALUES} numbers. Cut it.", line)
    if not found:
        line, why = wrong or (first, "there are no frames")
        raise ExchangeError(path, f"{why[0].upper()}{why[1:]}. Export the table again.", line)
    return np.stack(found), rows


def _numbers(text: str, separator: str, columns: int) -> Array:
    """The numbers of a row. Raises ValueError, in words."""
    words = (
        text.strip().split(separator) if '"' not in text else next(csv.reader([text], delimiter=separator))
    )
    if len(words) != columns:
        commas = len(words) == 2 * columns and separator == ","
        hint = " (decimal commas? Save it with semicolons between the fields)" if commas else ""
        raise ValueError(f"this line has {len(words)} values, the others {columns}{hint}")
    try:
        return np.array(words, np.float64)
    except ValueError:
        return np.array([_number(word.strip()) for word in words])


def _number(word: str) -> float:
    """A field, also with a decimal comma; NaN where it says that there is none. Raises ValueError."""
    if word.casefold() in _NONE:
        return np.nan
    try:
        return float(word.replace(",", ".", 1))
    except ValueError:
        raise ValueError(f"'{word[:40]}' is not a number") from None
