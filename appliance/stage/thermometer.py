"""The processor's temperature: on a hot stage it says why the box became slow."""

from __future__ import annotations

import os
from pathlib import Path

_ZONE = Path("/sys/class/thermal/thermal_zone0/temp")


class Thermometer:
    """Reads what Linux calls the first thermal zone: on a Raspberry Pi that is the processor."""

    def __init__(self, zone: Path = _ZONE) -> None:
        try:
            self._descriptor = os.open(zone, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self._descriptor = -1

    def celsius(self) -> float | None:
        """None on machines without one."""
        if self._descriptor < 0:
            return None
        try:
            return int(os.pread(self._descriptor, 32, 0)) / 1000.0
        except (OSError, ValueError):
            return None

    def close(self) -> None:
        """Release the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1
