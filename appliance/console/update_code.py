"""The code that an update from the page asks for: the test card shows it to people in the house."""

from __future__ import annotations

import contextlib
from pathlib import Path

CODE_FILE = "console.update"  # in the runtime folder


def pending_code(runtime: Path) -> str:
    """The code for the test card; "": none is asked for."""
    with contextlib.suppress(OSError):
        return (runtime / CODE_FILE).read_text()
    return ""
