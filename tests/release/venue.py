"""What a venue brings: a stick and a boot partition beside the box's own folders."""

from __future__ import annotations

import os
from pathlib import Path

from appliance.release.adoption import BoxFolders, Outcome, adopt
from appliance.release.arrivals import look

BROKEN = "broken"


class Venue:
    """A stick, a boot partition and the box's two folders; a show or box file is broken that says so."""

    def __init__(self, folder: Path) -> None:
        self.stick, self.boot = folder / "stick", folder / "boot"
        self.folders = BoxFolders(folder / "data", folder / "run")
        self.checked: list[tuple[Path, Path]] = []
        for one in (self.stick, self.boot, *self.folders):
            one.mkdir()

    def bring(self, where: Path, text: str, box: str | None = None) -> None:
        """A show with these words in it, or nothing; a box file with those, or nothing."""
        if text:
            (where / "show" / "profiles").mkdir(parents=True, exist_ok=True)
            (where / "show" / "show.yaml").write_text(text)
            (where / "show" / "puppet.onnx").write_bytes(os.urandom(300_000))
            (where / "show" / "profiles" / "head.yaml").write_text("a head")
        if box is not None:
            (where / "box.yaml").write_text(box)

    def look(self) -> Outcome:
        return adopt(self.folders, [look("stick", self.stick), look("boot", self.boot)], self._check)

    def _check(self, show: Path, box: Path) -> list[str]:
        self.checked.append((show, box))
        files = (show / "show.yaml", box)
        return [f"{file}:1: It says broken. Mend it." for file in files if BROKEN in file.read_text()]


def dancing(outcome: Outcome) -> str:
    return (outcome.choice.complete().first.show / "show.yaml").read_text()
