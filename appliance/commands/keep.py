"""`bunraku keep`: the keeper of this box, which carries the journal and the dance's place to the disk."""

from __future__ import annotations

from pathlib import Path

from appliance.show.box import BoxConfig
from appliance.stage.keeper import Carrier


def keep_box(box_file: Path | None, journal: Path | None = None) -> int:
    """Keep until a signal comes; the exit status. `journal`: another folder than the box file's."""
    raise NotImplementedError


def carriers(box: BoxConfig, runtime: Path, journal: Path | None) -> list[Carrier]:
    """What this box keeps: its journal; its place is appended here."""
    raise NotImplementedError
