"""The folder in which page and learner meet: the request, its progress and its result.

It is on the disk: what was begun goes on after a power cut.
"""

from __future__ import annotations

import importlib.util
import json
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.durable import private_folder, write_whole
from appliance.console.request_folder import RequestFolder
from appliance.pose.foreign_file import stored_json

FOLDER, RECORDINGS = "learning", "recordings"
UNDER_WAY = "waits", "training", "checking"  # states of a progress while something is wanted
SHORTEST_MIN, USUAL_MIN, LONGEST_MIN = 0.05, 60.0, 1440.0
STUDIO_MISSING = (
    "Learning needs the studio, which is not installed on this box: pip install bunraku-studio. The dance "
    "needs no studio: train on another machine, and bring the show on a stick."
)


def has_studio() -> bool:
    """Whether dancers can be trained here; nothing is imported for it."""
    return all(importlib.util.find_spec(name) is not None for name in ("appliance.studio", "torch", "onnx"))


class Wanted(NamedTuple):
    """recordings: their folder; minutes: for all of it, from reading to the check; begins_with: the folder or
    the name of the show whose dancer learns on, "": a new dancer.
    """

    recordings: str
    minutes: float = USUAL_MIN
    begins_with: str = ""


class Learning(RequestFolder[Wanted]):
    """`wanted.json` is there while something is learned. `show`: what is learned;
    `before`: what was learned before, while another learning begins with it.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, "wanted.json")
        self.show, self.before = folder / "show", folder / "before"
        self._progress = folder / "progress.json"

    def begin(self, wanted: Wanted) -> None:
        """Write the request, and delete the last learned show, or move it aside if this begins with it.

        Raises OSError. After a power cut in between nothing is wanted and the show is there, or `move_aside`
        ends what was begun.
        """
        with suppress(FileNotFoundError):
            shutil.rmtree(self.before)
        if wanted.begins_with == str(self.show):
            self.want(wanted)
            self.move_aside()
            return
        self.report(state="ended")  # half of a show is not offered
        shutil.rmtree(self.show, ignore_errors=True)
        self.want(wanted)

    def move_aside(self) -> None:
        """Move the last learned show aside where the request still begins with it. Raises OSError."""
        wanted = self.wanted()
        if wanted is not None and wanted.begins_with == str(self.show):
            if self.show.exists():
                self.show.rename(self.before)
            self.want(wanted._replace(begins_with=str(self.before)))

    def playable(self) -> Path | None:
        """The show that was learned last, once it has passed its check."""
        return self.show if self.reported().get("state") in ("learned", "worse") else None

    def _sound(self, said: Any) -> Wanted | None:
        recordings, minutes, before = said["recordings"], said["minutes"], said.get("begins_with", "")
        is_sound = (
            isinstance(recordings, str) and isinstance(minutes, int | float) and isinstance(before, str)
        )
        return Wanted(recordings, float(minutes), before) if is_sound else None

    def report(self, **values: object) -> None:
        """The progress from now on. Raises OSError."""
        private_folder(self.folder)
        write_whole(self._progress, json.dumps(values).encode())

    def reported(self) -> dict[str, Any]:
        """The progress; {} before the first. That of a learning before this one does not count."""
        try:
            reported = dict(stored_json(self._progress))
        except (OSError, ValueError, TypeError):
            reported = {}
        is_of_now = reported.get("state") in UNDER_WAY or self.wanted() is None
        return reported if is_of_now else {"state": UNDER_WAY[0]}
