"""dpkg and bunraku-release lose their power at one change of a file, or are watched."""

from __future__ import annotations

import functools
import subprocess
import tempfile
from pathlib import Path

from tests.deploy.box_root import BoxRoot

SOURCE = Path(__file__).with_name("cut.c")


@functools.cache
def _library() -> Path:
    built = Path(tempfile.mkdtemp(prefix="bunraku-cut-")) / "cut.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-w", "-o", built, SOURCE, "-ldl"], check=True)
    return built


def cutting(box: BoxRoot, at: int | str, log: Path) -> dict[str, str]:
    """The environment in which the power fails before change number `at`, or all are counted, or watched.

    log: a file seen by box and test, outside the box's disk.
    """
    seen = box.lend(_library())
    box.lend(log.parent)
    return {"LD_PRELOAD": str(seen), "CUT_AT": str(at), "CUT_LOG": str(log)}


def changes(log: Path) -> int:
    """How many there were."""
    return log.with_name(log.name + ".n").stat().st_size
