"""Files of tracked points: NPY or CSV with names, where gaps are not a number; what unit, which way is up."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appliance.exchange.exchange_error import ExchangeError
from appliance.pose.foreign_file import content, encoding_of, opened, opened_text
from appliance.pose.quaternion import Array
from appliance.studio.exchange.figure_facts import MAX_VALUES
from appliance.studio.exchange.table_reading import read_rows, separator_of

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_LARGEST_NAMES = 1 << 20
_TALLEST = {"m": 4.0, "cm": 400.0}  # a dancer with raised arms, with room for children and giants
_TIMES = {"time": 1.0, "times": 1.0, "seconds": 1.0, "timestamp": 1.0, "t": 1.0, "timeseconds": 1.0}
_TIMES |= {"timems": 1e-3, "milliseconds": 1e-3, "ms": 1e-3}  # titles of columns of times, in seconds
_COUNTS = ("", "frame", "frames", "frameno", "framenumber", "subframe", "index", "unnamed0", "no", "n")
_COORDINATE = re.compile(r"(?P<point>.*?)[._:\- ]?(?P<axis>[xyz])", re.IGNORECASE)
_FASTEST_FPS = 1000.0


@dataclass(frozen=True)
class Names:
    """The names of points, and of their parents where the file says them ('' for the root)."""

    names: tuple[str, ...]
    parents: tuple[str, ...] | None


def read_names(path: Path) -> Names:
    """A name on each line, or on each line a name and its parent: `LeftHand, LeftArm`; `Hips, -`.

    '#' begins a comment. Raises ExchangeError with the line.
    """
    try:
        data = content(path, _LARGEST_NAMES)
    except OSError as error:
        raise ExchangeError(path, f"The names cannot be read ({error.strerror}).") from error
    text = data.decode(encoding_of(data), "replace")
    if "\0" in text:
        raise ExchangeError(path, "This is not text. Write a name on each line.")
    names: list[str] = []
    parents: list[str] = []
    given = 0
    for line, written in enumerate(text.splitlines(), 1):
        words = [word.strip() for word in written.partition("#")[0].split(",")]
        if words == [""]:
            continue
        if len(words) > 2 or not all(words):
            raise ExchangeError(path, "A line has a name, or a name, a comma and its parent.", line)
        if words[0] in names:
            raise ExchangeError(path, f"'{words[0]}' is named twice.", line)
        if names and (len(words) == 2) != (given > 0):
            raise ExchangeError(path, "Give each name a parent ('-' for the root), or none of them.", line)
        given += len(words) == 2
        names.append(words[0])
        parents.append("" if words[-1] == "-" else words[-1])
    if not names:
        raise ExchangeError(path, "No name is in it.")
    for name, parent in zip(names, parents, strict=True):
        if given and parent and parent not in names:
            raise ExchangeError(path, f"The parent of '{name}', '{parent}', is no name in it.")
    return Names(tuple(names), tuple(parents) if given else None)


class Points(NamedTuple):
    """Points (N, P, 3) in a file's units and axes, not a number where one is missing; frames a second where
    its times say them; what was lost or left out, in words."""

    names: tuple[str, ...]
    places: Array
    fps: float | None
    notes: tuple[str, ...]


def read_points(path: Path, names: Names | None) -> Points:
    """The points of a file; names: in place of the file's. Raises ExchangeError with the line."""
    ending, notes = path.suffix.casefold(), list[str]()
    try:
        if ending == ".npy":
            found, places, fps = None, _read_npy(path), None
        elif ending == ".csv":
            found, places, fps, notes = _read_csv(path, names is None)
        else:
            raise ExchangeError(path, f"The ending '{path.suffix}' is no format of points: .npy or .csv.")
    except OSError as error:
        raise ExchangeError(path, f"The points cannot be read ({error.strerror}).") from error
    called = names.names if names is not None else found
    if called is None:
        raise ExchangeError(path, "Nothing says which point is which. Give a list: --names FILE.")
    if places.shape[1] != len(called):
        raise ExchangeError(
            path, f"It has {places.shape[1]} points, but {len(called)} names are given. Correct one."
        )
    return Points(called, np.where(np.isinf(places), np.nan, places), fps, tuple(notes))


def _read_npy(path: Path) -> Array:
    try:
        with opened(path) as stream:
            points = np.lib.format.read_array(stream, allow_pickle=False)
    except (ValueError, EOFError, MemoryError) as error:
        raise ExchangeError(path, f"This is no NPY file of numbers ({error}).") from error
    if points.dtype.kind not in "fiu":
        raise ExchangeError(path, f"Its values are no numbers but '{points.dtype}'.")
    if points.ndim == 2 and points.shape[1] % 3 == 0:
        points = points.reshape(len(points), -1, 3)
    if points.ndim != 3 or points.shape[2] != 3 or not points.size or points.size > MAX_VALUES:
        raise ExchangeError(
            path,
            f"Its shape is {points.shape}; it must be (frames, points, 3), with x, y, z last. In numpy: "
            "np.save(file, points.transpose(...)).",
        )
    numbers: Array = points.astype(np.float64)
    return numbers


def _read_csv(
    path: Path, names_wanted: bool
) -> tuple[tuple[str, ...] | None, Array, float | None, list[str]]:
    """The names where the first line has them, as NAME.x NAME.y NAME.z; the points, their rate, notes."""
    with opened_text(path) as file:
        first, line = 1, file.readline(1 << 20)
        while line and (not line.strip() or line.startswith("#")):
            first, line = first + 1, file.readline(1 << 20)
        separator = separator_of(line)
        head = [word.strip() for word in next(csv.reader([line], delimiter=separator), [])]
        titled = not all(_is_value(word) for word in head)
        if not titled:
            file.seek(0)
        values, rows = read_rows(path, file, separator, len(head), first + 1 if titled else 1)
    notes = rows.notes()
    whole: Array = np.full((rows.numbers[-1] - rows.numbers[0] + 1, len(head)), np.nan)
    whole[np.array(rows.numbers) - rows.numbers[0]] = values  # a row that is lost is a gap of all points
    fps, columns = None, [*head]
    while columns and (kind := _no_place(columns, whole, titled)):
        fps = fps or (_rate(whole[:, 0], kind) if kind > 0 else None)
        columns, whole = columns[1:], whole[:, 1:]
    if not titled and len(columns) < len(head):
        notes.append("the first column, which rises evenly, taken for the number of the frame or its time")
    if len(columns) % 3 or not columns:
        raise ExchangeError(
            path,
            f"{len(columns)} columns of positions are no multiple of three (x, y, z of each point).",
            first,
        )
    seen = np.flatnonzero(~np.isnan(whole).all(axis=1))
    if not len(seen):
        raise ExchangeError(path, "No row has a position.", first)
    names = _names_in(path, columns, first) if titled and names_wanted else None
    return names, whole[seen[0] : seen[-1] + 1].reshape(-1, len(columns) // 3, 3), fps, notes


def _no_place(columns: list[str], values: Array, titled: bool) -> float:
    """0 if the first column is a position; seconds in its unit for one of times, -1 for one that counts."""
    if titled:
        word = "".join(letter for letter in columns[0].casefold() if letter.isalnum())
        return _TIMES.get(word, -1.0 if word in _COUNTS else 0.0)
    steps = np.diff(values[:, 0])
    even = len(steps) > 1 and bool((steps > 0).all() and np.ptp(steps) < 0.01 * steps.mean())
    return -1.0 if even and len(columns) % 3 == 1 else 0.0


def _rate(times: Array, unit_s: float) -> float | None:
    """Frames a second by a column of times; None where it does not say one."""
    steps = np.diff(times)
    step = float(np.median(steps[np.isfinite(steps)])) * unit_s if np.isfinite(steps).any() else 0.0
    fps = 1.0 / step if step > 1.0 / (2 * _FASTEST_FPS) else 0.0
    near = round(fps)
    return None if fps < 1.0 else float(near) if abs(fps - near) < 0.01 * near else fps


def _names_in(path: Path, columns: list[str], line: int) -> tuple[str, ...]:
    names: list[str] = []
    for first in range(0, len(columns), 3):
        triple = columns[first : first + 3]
        found = [_COORDINATE.fullmatch(column) for column in triple]
        points = {match["point"] for match in found if match}
        axes = "".join(match["axis"] for match in found if match).casefold()
        if len(points) != 1 or axes != "xyz" or "" in points:
            raise ExchangeError(
                path, f"Columns {', '.join(triple)} are not NAME.x, NAME.y, NAME.z of one point.", line
            )
        names += points
    if len(set(names)) != len(names):
        raise ExchangeError(path, "Two points have the same name.", line)
    return tuple(names)


def _is_value(word: str) -> bool:
    try:
        float(word.replace(",", ".", 1) or "nan")
    except ValueError:
        return False
    return True


def figure_size(points: Array) -> float:
    """The usual size (median) of what is seen of a figure, in the units of its points (N, P, 3)."""
    whole = np.where(np.isnan(points).any(axis=2, keepdims=True), np.nan, points)
    seen = whole[~np.isnan(whole).all(axis=(1, 2))]
    return float(np.median(np.linalg.norm(np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1), axis=-1)))


def guess_unit(points: Array) -> str:
    """The unit in which these points (N, P, 3) are those of a person."""
    size = figure_size(points)
    return next((unit for unit, tallest in _TALLEST.items() if size < tallest), "mm")


def with_y_up(points: Array, up: str) -> Array:
    """Points whose vertical axis is `up` ('y' or 'z'), with y up."""
    return points if up == "y" else points[..., [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
