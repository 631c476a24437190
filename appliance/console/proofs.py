"""Proofs made on this box: certificates and doctor's reports, whole files, the newest are kept."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from appliance.box.durable import private_folder, write_whole
from appliance.pose.foreign_file import stored_json

FOLDER = "proofs"
MOST = 50  # two of a touring month; some 60 kB each
_NAME = re.compile(r"[0-9]{6}")


class Proofs:
    """A number for each document, `000012`: a box without a clock cannot sort them by their dates."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._read_at = -1
        self._listed: list[dict[str, Any]] = []

    def add(self, document: dict[str, Any]) -> str:
        """Keep it, and let the oldest go; its number. Raises OSError."""
        private_folder(self._folder)
        names = self._names()
        number = f"{int(names[-1]) + 1 if names else 1:06}"
        write_whole(self._folder / f"{number}.json", json.dumps({"id": number, **document}).encode())
        for old in names[: max(0, len(names) + 1 - MOST)]:
            (self._folder / f"{old}.json").unlink(missing_ok=True)
        return number

    def listed(self) -> list[dict[str, Any]]:
        """Number, kind, date and verdict of each, the newest first; a spoilt one is left out."""
        try:
            changed = self._folder.stat().st_mtime_ns
        except OSError:
            return []
        if changed != self._read_at:
            self._read_at = changed
            self._listed = [one for name in reversed(self._names()) if (one := self._summary(name))]
        return self._listed

    def content(self, number: str) -> bytes | None:
        """A document as it was written; None where there is none."""
        if _NAME.fullmatch(number) is None:
            return None
        try:
            return (self._folder / f"{number}.json").read_bytes()
        except OSError:
            return None

    def _summary(self, name: str) -> dict[str, Any] | None:
        try:
            document = stored_json(self._folder / f"{name}.json")
            return {"id": name} | {key: document[key] for key in ("kind", "made", "holds")}
        except (OSError, ValueError, TypeError, KeyError):
            return None

    def _names(self) -> list[str]:
        return sorted(path.stem for path in self._folder.glob("*.json") if _NAME.fullmatch(path.stem))
