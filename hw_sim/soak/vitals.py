"""Resources of a process: memory, handles, threads; and the machine's temperature."""

from __future__ import annotations

import contextlib
import os
import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Vitals:
    """Vitals of one process at one moment; memory in MB (million bytes)."""

    rss_mb: float
    anonymous_mb: float
    handles: int
    threads: int


def vitals(pid: int) -> Vitals | None:
    """None when the process is gone."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
        handles = len(os.listdir(f"/proc/{pid}/fd"))  # noqa: PTH208 (no object for each of them)
    except OSError:
        return None
    numbers = {name: int(value) for name, value in re.findall(r"^(\w+):\s+(\d+)", status, re.MULTILINE)}
    if "VmRSS" not in numbers:
        return None  # it is ending
    return Vitals(
        rss_mb=numbers["VmRSS"] * 1024 / 1e6,
        anonymous_mb=numbers.get("RssAnon", 0) * 1024 / 1e6,
        handles=handles,
        threads=numbers.get("Threads", 0),
    )


def warmest_c() -> float | None:
    """Highest temperature of all thermal zones, degrees Celsius; None on machines that do not report it."""
    found = []
    for zone in Path("/sys/class/thermal").glob("thermal_zone*/temp"):
        with contextlib.suppress(OSError, ValueError):
            found.append(int(zone.read_text()) / 1000.0)
    return max(found, default=None)
