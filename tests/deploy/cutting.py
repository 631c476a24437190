"""The environment in which install.sh loses its power, or is watched."""

from __future__ import annotations

import sys
from pathlib import Path

from tests.deploy.box_root import BoxRoot

HERE = Path(__file__).parent


def cutting(box: BoxRoot, at: int | str, log: Path) -> dict[str, str]:
    """The environment in which install.sh loses the power at command number `at`, or counts, or watches."""
    return {
        "BASH_ENV": str(HERE / "cut.bash"),
        "CUT_AT": str(at),
        "CUT_LOG": str(log),
        "CUT_ROOT": str(box.path),
        "CUT_DISK": str(box.written),
        "CUT_PYTHON": sys.executable,
        "CUT_PROGRAM": str(HERE / "cut.py"),
    }
