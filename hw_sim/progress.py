"""The progress of a measurement: a file of JSON objects, one a line, for a page that draws it."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path

from hw_sim.osc_receiver import decode
from hw_sim.peers import FRAME

_REPORTED_EVERY_S = 0.5
_LOGGED_WITHIN_S = 0.1  # the emulator logs a reading at most this long after the frame that carries it
_SENSOR, _SEQUENCE, _SENT_AT = 0, 2, 3  # columns of the emulator's log


class Progress:
    """Appends to a file; with None it tells nothing."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        if path is not None:
            path.write_bytes(b"")

    def report(self, **values: object) -> None:
        """One object: `phase` begins a run; `at_s`, `transport_ms` are readings of it; `figures` ends all."""
        if self._path is not None:
            with self._path.open("a") as stream:
                stream.write(json.dumps(values) + "\n")


class LiveTransport:
    """The transport of a run's readings while it goes on, as latency.transport gives it at the end.

    log: of the emulator. Each look takes some 0.1 ms, right after a frame: the next one is 20 ms away.
    """

    def __init__(self, progress: Progress, log: Path, sensor: str) -> None:
        self._progress, self._sensor = progress, sensor
        self._log = log.open()
        self._unread = ""
        self._waiting: dict[int, float] = {}  # readings that no frame has carried yet: sequence -> sent at
        self._frames: list[tuple[float, int]] = []  # arrival, the newest reading that it carries
        self._began: float | None = None
        self._reported_at = time.monotonic()
        self._at_s: list[float] = []
        self._transport_ms: list[float] = []

    def look(self, datagrams: Sequence[tuple[float, bytes]]) -> None:
        """Take the datagrams that came since the last look."""
        for arrival, datagram in datagrams:
            if datagram.startswith(FRAME):
                self._frames.append((arrival, int(decode(datagram)[0][1][2])))  # type: ignore[arg-type]
        now = time.monotonic()
        self._follow(now - _LOGGED_WITHIN_S)
        if now - self._reported_at >= _REPORTED_EVERY_S:
            self._report(now)

    def close(self) -> None:
        """Tell the rest, and release the log."""
        self._follow(time.monotonic())
        self._report(time.monotonic())
        self._log.close()

    def _report(self, now: float) -> None:
        if self._at_s:
            self._progress.report(at_s=self._at_s, transport_ms=self._transport_ms)
        self._at_s, self._transport_ms, self._reported_at = [], [], now

    def _follow(self, until: float) -> None:
        """The frames that arrived until then carry readings of the log."""
        self._read_log()
        while self._frames and self._frames[0][0] <= until:
            self._carried(*self._frames.pop(0))

    def _carried(self, arrival: float, newest: int) -> None:
        for sequence in [
            number for number, at in self._waiting.items() if number <= newest and at <= arrival
        ]:
            sent_at = self._waiting.pop(sequence)
            self._began = sent_at if self._began is None else self._began
            self._at_s.append(round(sent_at - self._began, 3))
            self._transport_ms.append(round(1000.0 * (arrival - sent_at), 3))

    def _read_log(self) -> None:
        *lines, self._unread = (self._unread + self._log.read()).split("\n")
        for fields in (line.split(",") for line in lines):
            if fields[_SENSOR] == self._sensor and fields[-1] == "":
                self._waiting.setdefault(int(fields[_SEQUENCE]), float(fields[_SENT_AT]))
