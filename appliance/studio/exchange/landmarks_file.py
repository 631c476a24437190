"""Landmarks that a network found in a video: MediaPipe's as JSON, CSV, NPY or NPZ, OpenPose's folder."""

from __future__ import annotations

import csv
import json
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.exchange.exchange_error import ExchangeError
from appliance.pose.foreign_file import content, opened, opened_text
from appliance.pose.point_layouts import IN_FILES, LAYOUTS, Layout
from appliance.pose.quaternion import Array

MEDIAPIPE = [
    "nose",
    "left_eye_inner",
    "left_eye",
    "left_eye_outer",
    "right_eye_inner",
    "right_eye",
    "right_eye_outer",
    "left_ear",
    "right_ear",
    "mouth_left",
    "mouth_right",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_pinky",
    "right_pinky",
    "left_index",
    "right_index",
    "left_thumb",
    "right_thumb",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "left_heel",
    "right_heel",
    "left_foot_index",
    "right_foot_index",
]  # as mediapipe.solutions.pose.PoseLandmark names them
USUAL_FPS = 30.0
_LARGEST = 1 << 30  # bytes of one file; MediaPipe's landmarks of an hour are 250 MB of JSON
_MOST_FRAMES = 1_000_000
_MS = 1e-3
_WORLD = ("world", "pose_world_landmarks", "poseWorldLandmarks", "worldLandmarks", "world_landmarks")
_IMAGE = ("image", "pose_landmarks", "poseLandmarks", "landmarks", "keypoints")
_TIMES = (("time", 1.0), ("timestamp", 1.0), ("seconds", 1.0), ("timestamp_ms", _MS), ("time_ms", _MS))
_AXES = ("x", "y", "z", "visibility")
_SEEN = ("visibility", "presence", "score", "confidence", "v")
_KEYPOINTS = re.compile(r"(?P<number>\d+)_keypoints\.json$")


@dataclass(frozen=True)
class LandmarksFile:
    """points (N, P, 3), not a number where nothing was seen: metres from the hips, or where is_flat pixels
    (z means nothing); seen (N, P): 0..1; times (N,): seconds; notes: what was guessed, in words.
    """

    layout: Layout
    points: Array
    seen: Array
    times: NDArray[np.float64]
    is_flat: bool
    notes: tuple[str, ...] = ()


def is_landmarks(path: Path) -> bool:
    """Whether the ending, or a folder, says that these are landmarks; .npy and .csv may be other points."""
    return path.is_dir() or path.suffix.casefold() in (".json", ".npz")


def read_landmarks(path: Path, fps: float | None = None) -> LandmarksFile:
    """Read them. fps: in place of the file's times. Raises ExchangeError with file and line."""
    try:
        if path.is_dir():
            found = _read_openpose(path)
        else:
            readers = {".json": _read_json, ".csv": _read_csv, ".npy": _read_arrays, ".npz": _read_arrays}
            reader = readers.get(path.suffix.casefold())
            if reader is None:
                raise ExchangeError(
                    path, "Landmarks are a .json, .csv, .npy or .npz file of MediaPipe, or OpenPose's folder."
                )
            found = reader(path)
    except OSError as error:
        raise ExchangeError(path, f"The landmarks cannot be read ({error.strerror}).") from error
    except (OverflowError, csv.Error) as error:
        raise ExchangeError(path, f"These are no landmarks ({error}).") from None
    layout, points, seen, times, is_flat = found
    if len(points) > _MOST_FRAMES:
        raise ExchangeError(path, f"{len(points):,} frames are more than {_MOST_FRAMES:,}. Cut the video.")
    if not (~np.isnan(points[..., 0])).any():
        raise ExchangeError(path, "Nobody was seen in any frame.")
    notes = []
    if fps is not None or times is None:
        rate = fps or USUAL_FPS
        times = np.arange(len(points)) / rate
        if fps is None:
            notes.append(f"no times are in it: taken as {rate:g} frames a second. If that is wrong: --fps")
    is_wrong = ~np.isfinite(times)
    is_wrong[1:] |= ~(np.diff(times) > 0)
    if is_wrong.any():
        at = int(is_wrong.argmax())
        raise ExchangeError(
            path, f"Frame {at} is not later than the one before. Give --fps in place of times."
        )
    if is_flat:
        notes.append("landmarks in the picture: their depth is estimated from the lengths of the limbs")
    return LandmarksFile(layout, points, np.clip(np.nan_to_num(seen), 0.0, 1.0), times, is_flat, tuple(notes))


_Read = tuple[Layout, Array, Array, NDArray[np.float64] | None, bool]


def _read_json(path: Path) -> _Read:
    text = content(path, _LARGEST)
    try:
        values = json.loads(text)
    except json.JSONDecodeError as error:
        raise ExchangeError(path, f"This is no JSON: {error.msg}.", error.lineno) from None
    except (ValueError, RecursionError) as error:  # another encoding; a number of thousands of digits
        raise ExchangeError(path, f"This is no JSON ({error}).") from None
    frames = values.get("frames") if isinstance(values, dict) else values
    if not isinstance(frames, list) or not frames:
        raise ExchangeError(
            path, "It has no list of frames: [{time, world: [[x, y, z, visibility] ...]} ...]."
        )
    rows, times = [], []
    key = next((one for one in (*_WORLD, *_IMAGE) for frame in frames if _has(frame, one)), None)
    for number, frame in enumerate(frames):
        where = f"Frame {number}"
        if not isinstance(frame, dict | list | None):
            raise ExchangeError(path, f"{where} is no frame but {str(frame)[:40]!r}.")
        given = frame.get(key) if isinstance(frame, dict) and key is not None else frame
        rows.append(_person(path, where, given if isinstance(given, list) else None))
        times.append(_time_of(path, where, frame) if isinstance(frame, dict) else None)
    known = [one for one in times if one is not None]
    if known and len(known) < len(times):
        raise ExchangeError(path, f"Frame {times.index(None)} has no time, and others have one.")
    fps = values.get("fps") if isinstance(values, dict) else None
    by_rate = np.arange(len(rows)) / fps if isinstance(fps, int | float) and fps > 0 else None
    points, seen = _stacked(rows, len(MEDIAPIPE))
    is_flat = key in _IMAGE or _is_picture(points)
    return LAYOUTS["mediapipe"], points, seen, np.array(known) if known else by_rate, is_flat


def _has(frame: Any, key: str) -> bool:
    return isinstance(frame, dict) and isinstance(frame.get(key), list) and bool(frame[key])


def _person(path: Path, where: str, given: list[Any] | None) -> Array | None:
    """(33, 4) of one frame; None: nobody was seen. The first of several persons."""
    if not given:
        return None
    if isinstance(given[0], list) and given[0] and isinstance(given[0][0], dict | list):
        given = given[0]
    if len(given) != len(MEDIAPIPE):
        raise ExchangeError(path, f"{where} has {len(given)} landmarks; MediaPipe has {len(MEDIAPIPE)}.")
    found = np.full((len(given), 4), np.nan)
    for number, one in enumerate(given):
        values = [one.get(axis, 1.0) for axis in _AXES] if isinstance(one, dict) else one
        if not isinstance(values, list) or not 2 <= len(values) <= 5 or not all(map(_is_number, values)):
            raise ExchangeError(path, f"{where}, landmark {number} ({MEDIAPIPE[number]}): {str(one)[:40]!r}.")
        found[number, : min(len(values), 4)] = [_or_nan(value) for value in values[:4]]
    found[:, 3] = np.where(np.isnan(found[:, 3]), 1.0, found[:, 3])
    return found


def _or_nan(value: float | None) -> float:
    """A number, or not a number for what is missing."""
    return np.nan if value is None else float(value)


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _time_of(path: Path, where: str, frame: Mapping[str, Any]) -> float | None:
    for key, unit in _TIMES:
        if key in frame:
            if not isinstance(frame[key], int | float):
                raise ExchangeError(path, f"{where}: its {key} is {str(frame[key])[:40]!r} and no number.")
            return float(frame[key]) * unit
    return None


def _stacked(rows: Sequence[Array | None], count: int) -> tuple[Array, Array]:
    whole = np.full((len(rows), count, 4), np.nan)
    for number, row in enumerate(rows):
        if row is not None:
            whole[number] = row
    return whole[..., :3], whole[..., 3]


def _is_picture(points: Array) -> bool:
    """Whether these are places in a picture (0..1, or pixels): world landmarks count from the hips."""
    hips = np.abs(points[:, 23:25, :2].mean(axis=1))
    hips = hips[~np.isnan(hips).any(axis=1)]
    return len(hips) > 0 and float(np.median(hips)) > 0.05


def _read_csv(path: Path) -> _Read:
    with opened_text(path) as file:
        reader = csv.reader(file)
        head = [word.strip().casefold() for word in next(reader, [])]
        if "landmark" in head:
            return _read_long(path, head, reader)
        columns = _columns(path, head)
        timed = next(((head.index(key), unit) for key, unit in _TIMES if key in head), None)
        rows, times = [], []
        for line, words in enumerate(reader, 2):
            if not words:
                continue
            if len(words) < len(head):
                raise ExchangeError(path, f"It has {len(words)} values; the title has {len(head)}.", line)
            row = np.full((len(MEDIAPIPE), 4), np.nan)
            row[:, 3] = 1.0
            for (landmark, axis), column in columns.items():
                row[landmark, axis] = _number(path, line, words[column])
            rows.append(row)
            times.append(_number(path, line, words[timed[0]]) * timed[1] if timed else 0.0)
    points, seen = _stacked(rows, len(MEDIAPIPE))
    return LAYOUTS["mediapipe"], points, seen, np.array(times) if timed else None, _is_picture(points)


def _columns(path: Path, head: Sequence[str]) -> dict[tuple[int, int], int]:
    """(landmark, axis) to its column: left_wrist_x, LEFT_WRIST.x, x15, 15_x."""
    found: dict[tuple[int, int], int] = {}
    words = "|".join(MEDIAPIPE)
    named = re.compile(rf"(?:({words})|(\d+))[._ ]?(x|y|z|{'|'.join(_SEEN)})")
    numbered = re.compile(rf"(x|y|z|{'|'.join(_SEEN)})[._ ]?(\d+)")
    for column, title in enumerate(head):
        if match := named.fullmatch(title):
            place = MEDIAPIPE.index(match[1]) if match[1] else int(match[2])
            axis = match[3]
        elif match := numbered.fullmatch(title):
            axis, place = match[1], int(match[2])
        else:
            continue
        if place < len(MEDIAPIPE):
            found[place, "xyz".find(axis) if axis in "xyz" else 3] = column
    missing = [name for number, name in enumerate(MEDIAPIPE) if (number, 0) not in found]
    if missing:
        raise ExchangeError(
            path,
            f"Its title lacks {missing[0]}_x and {len(missing) - 1} more. Titles are NAME_x, NAME_y, NAME_z, "
            "NAME_visibility, or frame, landmark, x, y, z, visibility in a row for each landmark.",
            1,
        )
    return found


def _read_long(path: Path, head: Sequence[str], reader: Iterator[list[str]]) -> _Read:
    """A row for each landmark of each frame."""
    places = {name: head.index(name) for name in ("landmark", "x", "y") if name in head}
    if len(places) < 3 or not {"frame", "time", "timestamp_ms"} & set(head):
        raise ExchangeError(path, "Its title needs frame or time, landmark, x, y, z.", 1)
    timed = next(((head.index(key), unit) for key, unit in _TIMES if key in head), None)
    counted = head.index("frame") if "frame" in head else (timed or (0, 1.0))[0]
    z = head.index("z") if "z" in head else None
    visible = next((head.index(one) for one in _SEEN if one in head), None)
    frames: dict[str, Array] = {}
    times: dict[str, float] = {}
    for line, words in enumerate(reader, 2):
        if not words:
            continue
        if len(words) < len(head):
            raise ExchangeError(path, f"It has {len(words)} values; the title has {len(head)}.", line)
        name = words[places["landmark"]].strip().casefold()
        number = MEDIAPIPE.index(name) if name in MEDIAPIPE else int(name) if name.isdigit() else -1
        if not 0 <= number < len(MEDIAPIPE):
            raise ExchangeError(path, f"No landmark of MediaPipe is called {name!r}.", line)
        frame = frames.setdefault(words[counted], np.full((len(MEDIAPIPE), 4), np.nan))
        values = [words[places["x"]], words[places["y"]], "nan" if z is None else words[z]]
        frame[number, :3] = [_number(path, line, word) for word in values]
        frame[number, 3] = 1.0 if visible is None else _number(path, line, words[visible])
        if timed:
            times[words[counted]] = _number(path, line, words[timed[0]]) * timed[1]
    points, seen = _stacked(list(frames.values()), len(MEDIAPIPE))
    given_times = np.array([times[key] for key in frames]) if timed and frames else None
    return LAYOUTS["mediapipe"], points, seen, given_times, z is None or _is_picture(points)


def _number(path: Path, line: int, word: str) -> float:
    try:
        return float(word) if word.strip() else np.nan
    except ValueError:
        raise ExchangeError(path, f"{word[:40]!r} is no number.", line) from None


def _read_arrays(path: Path) -> _Read:
    times = None
    try:
        if path.suffix.casefold() == ".npy":
            with opened(path) as stream:
                points = np.lib.format.read_array(stream, allow_pickle=False)
        else:
            with opened(path) as stream, np.load(stream, allow_pickle=False) as stored:
                name = next((one for one in ("world", "landmarks", "points") if one in stored), None)
                if name is None:
                    raise ValueError(f"it has {', '.join(stored)}, and nothing called world or landmarks")
                points = stored[name]
                if "times" in stored:
                    times = stored["times"].astype(float)
                elif "fps" in stored:
                    fps = float(stored["fps"])
                    if not 0 < fps < np.inf:
                        raise ValueError(f"its fps is {fps:g}")
                    times = np.arange(len(points)) / fps
    except (
        ValueError,
        EOFError,
        MemoryError,
        KeyError,
        TypeError,
        RuntimeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise ExchangeError(path, f"These are no landmarks of numpy ({error}).") from None
    if points.ndim == 2 and len(points) and points.shape[1] % len(MEDIAPIPE) == 0:
        points = points.reshape(len(points), len(MEDIAPIPE), -1)
    if points.ndim != 3 or points.shape[1] != len(MEDIAPIPE) or not 2 <= points.shape[2] <= 5:
        raise ExchangeError(path, f"Its shape is {points.shape}; it must be (frames, 33, 3 to 5).")
    if points.dtype.kind not in "fiu" or (times is not None and times.shape != (len(points),)):
        raise ExchangeError(path, "Its values are no numbers, or it has not a time for each frame.")
    whole = np.full((*points.shape[:2], 4), 1.0)
    whole[..., : min(points.shape[2], 4)] = points[..., :4]
    is_flat = points.shape[2] == 2 or _is_picture(whole[..., :3])
    return LAYOUTS["mediapipe"], whole[..., :3], whole[..., 3], times, is_flat


def _read_openpose(folder: Path) -> _Read:
    """NUMBER_keypoints.json of each frame; of several persons the one who goes on from the frame before."""
    numbered = sorted(
        (int(match["number"]), path)
        for path in folder.iterdir()
        if (match := _KEYPOINTS.search(path.name)) is not None
    )
    if not numbered:
        raise ExchangeError(
            folder, "It has no file ..._keypoints.json, as OpenPose's --write_json makes them."
        )
    rows: list[Array | None] = [None] * (numbered[-1][0] - numbered[0][0] + 1)
    if len(rows) > _MOST_FRAMES:
        raise ExchangeError(folder, f"Its files are numbered over {len(rows):,} frames. Number them anew.")
    before: Array | None = None
    is_flat = True
    for number, path in numbered:
        people, is_flat = _people(path)
        if not people:
            continue
        chosen = min(people, key=lambda one: _apart(one, before))
        if before is not None and before.shape != chosen.shape:
            raise ExchangeError(
                path, f"It has {len(chosen)} key points; the files before have {len(before)}."
            )
        rows[number - numbered[0][0]] = before = chosen
    if before is None:
        raise ExchangeError(folder, "Nobody was seen in any frame.")
    layout = next(one for one in IN_FILES.values() if len(one.parts) == len(before))
    points, seen = _stacked(rows, len(before))
    return layout, points, seen, None, is_flat


def _people(path: Path) -> tuple[list[Array], bool]:
    """(P, 4) of each person: x, y, z, confidence; and whether they are in the picture."""
    try:
        people = json.loads(content(path, 1 << 24))["people"]
        flat = not any(one.get("pose_keypoints_3d") for one in people)
        key, size = ("pose_keypoints_2d", 3) if flat else ("pose_keypoints_3d", 4)
        found = [np.array(one[key], dtype=float).reshape(-1, size) for one in people if one.get(key)]
    except json.JSONDecodeError as error:
        raise ExchangeError(path, f"This is no JSON: {error.msg}.", error.lineno) from None
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise ExchangeError(path, f"This is no file of OpenPose's ({str(error)[:80]}).") from None
    whole = []
    for one in found:
        if len(one) not in (len(layout.parts) for layout in IN_FILES.values()):
            raise ExchangeError(path, f"{len(one)} key points: BODY_25 has 25, COCO has 18.")
        person = np.zeros((len(one), 4))
        person[:, : size - 1], person[:, 3] = one[:, : size - 1], one[:, size - 1]
        person[one[:, size - 1] <= 0.0] = np.nan  # OpenPose writes 0, 0, 0 for what it did not see
        whole.append(person)
    return [one for one in whole if not np.isnan(one[:, 0]).all()], flat


def _apart(person: Array, before: Array | None) -> float:
    """Distance from the person before; of the first frame minus the person's size: the largest is meant."""
    if before is None or before.shape != person.shape:
        return -float(np.linalg.norm(np.nanmax(person[:, :2], axis=0) - np.nanmin(person[:, :2], axis=0)))
    with np.errstate(invalid="ignore"):
        gaps = np.linalg.norm(person[:, :2] - before[:, :2], axis=-1)
    return float(np.nanmean(gaps)) if (~np.isnan(gaps)).any() else np.inf
