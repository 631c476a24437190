"""A night at a glance: what went wrong when, what happened, and any stretch of the dance for a browser."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from appliance.outputs.frame_layout import BROWSER_HEAD
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import Run
from appliance.recorder.record import LATE, NOT_FINITE, holds_of

MOST_BINS, MOST_EVENTS = 240, 400
EVERY = 2  # ticks from one frame of a stretch to the next
_LONG_WORD = re.compile(r"[\w+/=]{60,}")  # numbers packed as text: nobody reads them


def timeline(number: int, run: Run) -> dict[str, Any]:
    """A run in at most MOST_BINS bins of equal length, and its newest events.

    begun: seconds since 1970; late, skipped, failed: ticks of each bin; slowest_ms: its slowest tick. events:
    second of the run, kind, words.
    """
    ticks, begun = run.ticks, float(run.ticks["frame_time"][0])
    at = ticks["frame_time"] - begun
    seconds = float(at[-1]) + run.header["tick_s"]
    width = max(1.0, seconds / MOST_BINS)
    count = max(1, int(np.ceil(seconds / width)))
    place = np.clip(np.nan_to_num(at / width).astype(np.int64), 0, count - 1)
    slowest = np.zeros(count)
    np.maximum.at(slowest, place, np.nan_to_num(ticks["sections_ms"].sum(axis=1)))

    def of(weights: Any) -> list[int]:
        return [int(value) for value in np.bincount(place, weights, count)]

    return {
        "number": number,
        "begun": run.header["written_at"],
        "show": run.header["show"],
        "seconds": round(seconds, 2),
        "bin_s": width,
        "late": of((ticks["flags"] & LATE) != 0),
        "skipped": of(ticks["skipped"].astype(float)),
        "failed": of((ticks["flags"] & NOT_FINITE) != 0),
        "slowest_ms": slowest.round(2).tolist(),
        "events": [
            [round(event["now"] - begun, 2), event["kind"], message_of(event)]
            for _, event in run.events[-MOST_EVENTS:]
        ],
    }


def message_of(event: dict[str, Any]) -> str:
    """An order, and the reply to it."""
    asked = event.get("order", {})
    parts = [asked.get("name", ""), asked.get("text", ""), *asked.get("values", ()), event.get("message", "")]
    refused = ["(refused)"] * (event.get("done") is False)
    return _LONG_WORD.sub("…", " ".join(filter(None, map(str, [*parts, *refused]))))


def stretch(run: Run, start_s: float, seconds: float) -> Iterator[bytes]:
    """A stretch of a run for the page: the length of a JSON text (uint32), that text, then frames.

    The text: joints, parents, ends, begun (seconds since 1970), start_s, every_s. A frame: tick, flags,
    joints, then world rotations (w, x, y, z), positions (metres) and holds 0 to 1, float32, as the page gets
    the live dance. Raises JournalError where nothing was danced then.
    """
    ticks = run.ticks
    at = ticks["frame_time"] - ticks["frame_time"][0]
    chosen = np.flatnonzero((at >= start_s) & (at < start_s + seconds))[::EVERY]
    if not len(chosen):
        raise JournalError(f"Nothing was danced at second {start_s:g} of this run.")
    skeleton = run.skeleton
    facts = {
        "joints": skeleton.names,
        "parents": skeleton.parents,
        "ends": skeleton.ends,
        "begun": run.header["written_at"],
        "start_s": float(at[chosen[0]]),
        "every_s": EVERY * run.header["tick_s"],
    }
    text = json.dumps(facts).encode()
    yield struct.pack("<I", len(text)) + text
    part = ticks[chosen]
    positions, world = skeleton.forward_kinematics(part["pose"][:, 0], part["root"][:, 0])
    holds = holds_of(run.header, part)[:, 0]
    for place, tick in enumerate(part):
        head = BROWSER_HEAD.pack(tick["tick"], int(tick["flags"]) & LATE, len(skeleton))
        arrays = (world[place], positions[place], holds[place])
        yield head + b"".join(array.astype("<f4").tobytes() for array in arrays)
