"""The box's memory of gestures, by show, as a record: text in memory and on the disk."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from appliance.box.record import Record, WholeFile
from appliance.pose.foreign_file import plain_json
from appliance.sensor.gestures import LONGEST_S, RATE_HZ, Gesture

FILE_NAME = "gestures.memory"
LARGEST = 1024 * 1024  # bytes
MOST = 16  # gestures of a show
_LONGEST = round(LONGEST_S * RATE_HZ) + 1


def gesture_record(state: Path) -> Record:
    """In memory, and valid only for this state folder."""
    return Record(FILE_NAME, "gestures", LARGEST, os.fsencode(state.absolute()))


def gesture_file(state: Path) -> WholeFile:
    """On the disk."""
    return WholeFile(state / FILE_NAME, LARGEST)


def gestures_text(shows: Mapping[str, Iterable[Gesture]]) -> bytes:
    """The record of the gestures of each show."""
    return json.dumps(
        {
            show: [
                {
                    "name": one.name,
                    "cue": one.cue,
                    "hand": one.hand,
                    "within": round(one.within, 5),
                    "takes": [np.round(take.astype(float), 4).tolist() for take in one.takes],
                }
                for one in gestures
            ]
            for show, gestures in shows.items()
        }
    ).encode()


def read_gestures(text: bytes) -> dict[str, list[Gesture]]:
    """The gestures of each show. Raises ValueError for what no box has written."""
    try:
        return {
            str(show): [
                Gesture(
                    *(str(one["name"]), str(one["cue"]), str(one["hand"])),
                    tuple(map(_take, one["takes"])),
                    float(one["within"]),
                )
                for one in gestures[:MOST]
            ]
            for show, gestures in plain_json(text).items()
        }
    except (LookupError, TypeError, AttributeError) as error:
        raise ValueError(f"These are no gestures ({error}).") from None


def _take(numbers: object) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    take = np.array(numbers, np.float32)
    if take.ndim != 2 or take.shape[1] != 4 or not 4 <= len(take) <= _LONGEST:
        raise ValueError("A repetition of a gesture has another shape.")
    if not (np.abs(np.linalg.norm(take, axis=1) - 1.0) < 0.01).all():
        raise ValueError("A repetition of a gesture has numbers that are no orientations.")
    return take
