"""`bunraku replay`: dance a journal again through the same tick, and say where it differs."""

from __future__ import annotations

from pathlib import Path


def replay_journal(journal: Path, show: Path | None, from_s: float, tolerance_degrees: float | None) -> int:
    """Print what was replayed and the first tick that differs; 0 when none does, else 1."""
    raise NotImplementedError
