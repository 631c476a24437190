"""Recordings from tables, as `appliance/exchange/tables.py` writes them or a spreadsheet saves that."""

from __future__ import annotations

import csv
import zipfile
import zlib
from collections.abc import Sequence
from io import TextIOWrapper
from pathlib import Path

import numpy as np

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.tables import MARK, columns_of
from appliance.pose.foreign_file import opened, opened_text, plain_json
from appliance.pose.kept_rows import KeptRows
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.exchange.figure_facts import MAX_VALUES, checked_recording, checked_skeleton

_LONGEST_LINE = 1 << 20
_SHOWN = 6
_NONE = ("", "na", "n/a", "#n/a", "nan", "null", "none", "-", "--", ".")  # fields without a value
_NEEDED = ("poses", "roots", "fps", "names", "parents", "offsets")


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
        wanted = columns_of(names, stretched)[1:]
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
    words = text.strip(" \r\n").split(separator)  # a tab at an end is a field without a value
    if '"' in text:
        try:
            words = next(csv.reader([text], delimiter=separator))
        except csv.Error as error:
            raise ValueError(f"this line is no row of a table ({error})") from None
    while len(words) > columns and not words[-1].strip():
        words.pop()
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
