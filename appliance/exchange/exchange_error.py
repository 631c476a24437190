"""Faults of a file that goes in or out, in words for people."""

from __future__ import annotations

from pathlib import Path

from appliance.pose.correctable_error import CorrectableError


class ExchangeError(CorrectableError, ValueError):
    """A file that cannot be read or written: which one, where in it, what is wrong and what to do.

    line: 0 where the file has none.
    """

    def __init__(self, path: Path, message: str, line: int = 0) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}:{line}: {message}" if line else f"{path}: {message}")
