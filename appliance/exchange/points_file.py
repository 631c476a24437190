"""Files of tracked points: NPY or CSV with names, where gaps are not a number; what unit, which way is up."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path

import numpy as np

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.figure_facts import MAX_VALUES
from appliance.exchange.tables import read_rows
from appliance.pose.foreign_file import content, opened
from appliance.pose.quaternion import Array

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_LARGEST_NAMES = 1 << 20
_TALLEST = {"m": 4.0, "cm": 400.0}  # a dancer with raised arms, with room for children and giants
_TIMES = ("time", "frame")


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
        text = content(path, _LARGEST_NAMES).decode("utf-8-sig")
    except OSError as error:
        raise ExchangeError(path, f"The names cannot be read ({error.strerror}).") from error
    except UnicodeDecodeError as error:
        raise ExchangeError(path, "This is not text. Write a name on each line.") from error
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


def read_points(path: Path, names: Names | None) -> tuple[tuple[str, ...], Array]:
    """The names, and the points (N, P, 3) in the file's units and axes; not a number where one is missing.

    Raises ExchangeError with the line.
    """
    try:
        if path.suffix.lower() == ".npy":
            points = _read_npy(path)
        elif path.suffix.lower() == ".csv":
            found, points = _read_csv(path)
            names = names or (None if found is None else Names(found, None))
        else:
            raise ExchangeError(path, f"The ending '{path.suffix}' is no format of points: .npy or .csv.")
    except OSError as error:
        raise ExchangeError(path, f"The points cannot be read ({error.strerror}).") from error
    if names is None:
        raise ExchangeError(path, "Nothing says which point is which. Give a list: --names FILE.")
    if points.shape[1] != len(names.names):
        raise ExchangeError(
            path, f"It has {points.shape[1]} points, but {len(names.names)} names are given. Correct one."
        )
    if np.isinf(points).any():
        frame = int(np.argwhere(np.isinf(points))[0][0])
        raise ExchangeError(path, f"Frame {frame}: a position is infinite. Write NaN for a missing point.")
    return names.names, points


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


def _read_csv(path: Path) -> tuple[tuple[str, ...] | None, Array]:
    """The names where the first line has them, as NAME.x NAME.y NAME.z; the points."""
    with TextIOWrapper(opened(path), encoding="utf-8-sig", errors="replace") as file:
        head = next(csv.reader([file.readline(1 << 20)]), [])
        titled = not all(_is_value(word) for word in head)
        if not titled:
            file.seek(0)
        rows = read_rows(path, file, len(head), 1 + titled, gaps=True)
    columns = [word.strip() for word in head]
    while titled and columns and columns[0].casefold() in _TIMES:
        columns, rows = columns[1:], rows[:, 1:]
    if rows.shape[1] % 3 or not rows.shape[1]:
        raise ExchangeError(
            path, f"{rows.shape[1]} columns of positions are no multiple of three (x, y, z of each point).", 1
        )
    names = None
    if titled:
        for first in range(0, len(columns), 3):
            triple = columns[first : first + 3]
            stems = {column[:-2] for column in triple}
            if len(stems) != 1 or [column[-1:].casefold() for column in triple] != ["x", "y", "z"]:
                raise ExchangeError(
                    path, f"Columns {', '.join(triple)} are not NAME.x, NAME.y, NAME.z of one point.", 1
                )
        names = tuple(column[:-2] for column in columns[::3])
        if len(set(names)) != len(names):
            raise ExchangeError(path, "Two points have the same name.", 1)
    return names, rows.reshape(len(rows), -1, 3)


def _is_value(word: str) -> bool:
    try:
        float(word.strip() or "nan")
    except ValueError:
        return False
    return True


def guess_unit(points: Array) -> str:
    """The unit in which these points (N, P, 3) are those of a person."""
    size = float(np.nanmedian(np.linalg.norm(np.nanmax(points, axis=1) - np.nanmin(points, axis=1), axis=-1)))
    return next((unit for unit, tallest in _TALLEST.items() if size < tallest), "mm")


def with_y_up(points: Array, up: str) -> Array:
    """Points whose vertical axis is `up` ('y' or 'z'), with y up."""
    return points if up == "y" else points[..., [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
