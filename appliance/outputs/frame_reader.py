"""The readers' end of the shared frame: the newest frames, whole or not at all."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from appliance.box.ring_file import RingFileReader
from appliance.outputs.frame_layout import (
    FACTS,
    FILE,
    FORMAT,
    FRAME_HEAD,
    FRAMES,
    HEALTH,
    KIND,
    LATE,
    WRITER,
    FrameLayout,
)
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import Facts, others_in, puppets_in
from appliance.pose.foreign_file import plain_json

State = Literal["absent", "fresh", "stale"]
STALE_S = 0.5
_POLL_S = 0.1  # how often the file system is checked for a new stage
_AHEAD_S = 1.0  # no reader's clock is this far behind the stage's


class FrameReader:
    """Reads the shared frame of the running stage; never waits, never raises, never disturbs the stage.

    facts: of the newest stage, None before the first. generation: changes with each new stage. Frames and
    facts of a stage that is gone stay until the next one. `now` may be old, if the reader was held up.
    """

    def __init__(self, folder: Path, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        self._file = RingFileReader(folder / FILE, KIND, FORMAT, WRITER)
        self._followed_at = -math.inf
        self._writer_lives = False
        self._layout = FrameLayout(0)
        self.facts: Facts | None = None
        self.generation = 0
        self._open()

    @property
    def complaint(self) -> str:
        """Why an existing file cannot be read, a sentence; else empty."""
        return self._file.complaint

    def newest(self, now: float) -> JointFrame | None:
        """A copy of the newest whole frame, however old it is; None before the first one."""
        self._follow(now)
        if not self._file.rings:
            return None
        found = self._file.rings[FRAMES].newest()
        return self._frame(found[1], now) if found else None

    def frames(self, count: int, now: float) -> list[JointFrame]:
        """At most `count` of the newest frames of this stage, newest last; torn ones are skipped."""
        self._follow(now)
        if not self._file.rings:
            return []
        ring = self._file.rings[FRAMES]
        newest = ring.newest_sequence()
        payloads = map(ring.payload, range(max(newest - count, 0) + 1, newest + 1))
        seen = (self._frame(payload, now) for payload in payloads if payload is not None)
        return [frame for frame in seen if frame is not None]

    def health(self) -> dict[str, Any] | None:
        """The newest health report of the stage; None before the first."""
        found = self._file.rings[HEALTH].newest() if self._file.rings else None
        if found is None:
            return None
        try:
            said = plain_json(found[1])
        except ValueError:
            return None
        return said if isinstance(said, dict) else None

    def state(self, now: float) -> State:
        """absent: no stage; stale: its newest frame is older than STALE_S, or it died; else fresh."""
        newest = self.newest(now)
        if not self._file.is_there or newest is None:
            return "absent"
        return "fresh" if self._writer_lives and now - newest.frame_time <= STALE_S else "stale"

    def is_alive(self, now: float) -> bool:
        """Whether the writing process lives; if it hangs, `state` is stale."""
        self._follow(now)
        return self._writer_lives

    def close(self) -> None:
        self._file.close()

    def _follow(self, now: float) -> None:
        if abs(now - self._followed_at) >= _POLL_S:
            self._followed_at = now
            self._open()

    def _open(self) -> None:
        """Open the newest stage's file and check whether that stage lives."""
        if self._file.look():
            self._take_facts()
        self._writer_lives = self._file.is_there and self._file.writer_lives()

    def _take_facts(self) -> None:
        """Take the facts of a new file."""
        rings = self._file.rings
        if not rings:
            return
        found = rings[FACTS].newest() if len(rings) > FRAMES else None
        try:
            self.facts = Facts.unpacked(found[1] if found else b"")
        except (ValueError, KeyError, TypeError):
            self._file.refuse(f"holds no facts about a show. Start {WRITER} again.")
            return
        self._layout = self.facts.layout
        self.generation += 1

    def _frame(self, payload: bytes, now: float) -> JointFrame | None:
        """None for frames that must not be shown: not finite, or from before this machine's restart."""
        layout = self._layout
        if len(payload) != layout.bytes:
            return None
        tick, frame_time, left, sequence, arrival, flags, _ = FRAME_HEAD.unpack_from(payload)
        numbers = np.frombuffer(payload, "<f4", -1, layout.root_at)
        is_ahead = frame_time > now + _AHEAD_S and frame_time > self._monotonic() + _AHEAD_S
        if is_ahead or not np.isfinite(numbers).all():
            return None
        puppets = puppets_in(payload, layout)
        others = others_in(payload, layout)
        return JointFrame(puppets, tick, frame_time, bool(flags & LATE), sequence, arrival, left, *others)
