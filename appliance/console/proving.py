"""The folder in which page and prover meet: what is wanted, and what was measured so far."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.durable import private_folder
from appliance.console.request_folder import RequestFolder

FOLDER = "prove"
KINDS = ("latency", "doctor")
SHORTEST_S, LONGEST_S = 6, 300
SHOW_GOES = "The show goes on, and a second dance beside it would cost it time. Stop the show, then measure."
_SILENT_S = 30.0  # a prover that says nothing for this long is gone; it gives a sign five times a second


class Wanted(NamedTuple):
    """The kind of proof, and for how long (seconds; only for a latency)."""

    kind: str
    seconds: int


class Proving(RequestFolder[Wanted]):
    """`wanted` is there while something is proven. `progress`: JSON, one a line.
    `sign`: its time is the last sign of life, in monotonic seconds: a clock that is set moves all others.
    """

    def __init__(self, runtime: Path) -> None:
        super().__init__(runtime / FOLDER, "wanted")
        self.progress, self._sign = self.folder / "progress", self.folder / "sign"

    def want(self, wanted: Wanted) -> None:
        """Begin: an empty progress, then the request. Raises OSError."""
        private_folder(self.folder)
        self.progress.write_bytes(b"")
        self._sign.touch(mode=0o600)
        self.report()
        super().want(wanted)

    def _sound(self, said: Any) -> Wanted | None:
        kind, seconds = said["kind"], said["seconds"]
        if kind not in KINDS or not isinstance(seconds, int) or not SHORTEST_S <= seconds <= LONGEST_S:
            return None
        return Wanted(kind, seconds)

    def report(self, **values: object) -> None:
        """One more object of the progress; without any, a sign of life."""
        if values:
            with self.progress.open("a") as stream:
                stream.write(json.dumps(values) + "\n")
        now = time.monotonic()
        os.utime(self._sign, (now, now))

    def is_silent(self) -> bool:
        """Whether what is wanted gives no sign any more."""
        try:
            return time.monotonic() - self._sign.stat().st_mtime > _SILENT_S
        except OSError:
            return True
