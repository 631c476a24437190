"""The folder in which page and prover meet: what is wanted, what was measured so far; and who may begin."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import NamedTuple

from appliance.box.durable import private_folder
from appliance.box.show_state import ShowStateReader
from appliance.console.stage_view import StageView
from appliance.pose.foreign_file import stored_json

FOLDER = "prove"
KINDS = ("latency", "doctor")
SHORTEST_S, LONGEST_S = 6, 300
SHOW_GOES = "The show goes on, and a second dance beside it would cost it time. Stop the show, then measure."
_SILENT_S = 30.0  # a prover that says nothing for this long is gone; it gives a sign five times a second


class Wanted(NamedTuple):
    """The kind of proof, and for how long (seconds; only for a latency)."""

    kind: str
    seconds: int


class Proving:
    """`wanted` is there while something is proven: its removal ends that. `progress`: JSON, one a line.
    `sign`: its time is the last sign of life, in monotonic seconds: a clock that is set moves all others.
    """

    def __init__(self, runtime: Path) -> None:
        self._runtime = runtime
        self.folder = runtime / FOLDER
        self._wanted, self.progress = self.folder / "wanted", self.folder / "progress"
        self._sign = self.folder / "sign"

    def want(self, wanted: Wanted) -> None:
        """Begin: an empty progress, then the request. Raises OSError."""
        private_folder(self.folder)
        self.progress.write_bytes(b"")
        self._sign.touch(mode=0o600)
        self.report()
        part = self.folder / ".wanted"
        part.write_text(json.dumps(wanted._asdict()))
        part.replace(self._wanted)

    def wanted(self) -> Wanted | None:
        """The current request; None: nothing, or nothing that can be read."""
        try:
            said = stored_json(self._wanted)
            kind, seconds = said["kind"], said["seconds"]
        except (OSError, ValueError, TypeError, KeyError):
            return None
        if kind not in KINDS or not isinstance(seconds, int) or not SHORTEST_S <= seconds <= LONGEST_S:
            return None
        return Wanted(kind, seconds)

    def end(self) -> None:
        """Nothing is wanted any more."""
        self._wanted.unlink(missing_ok=True)

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

    def show_goes(self) -> bool:
        """Whether a dance is on: a stage that lives, and a show that was not stopped."""
        stage, state = StageView(self._runtime), ShowStateReader(self._runtime)
        try:
            now = time.monotonic()
            return stage.state(now) == "fresh" and not state.read().stands(now)
        finally:
            stage.close()
            state.close()
