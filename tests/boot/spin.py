"""Makes a running process spin for ever, from outside: where it waits, it jumps to itself from now on."""

from __future__ import annotations

import platform
import time
from pathlib import Path

from tests.boot.machine import PATIENCE_S

_JUMP_TO_ITSELF = {"x86_64": b"\xeb\xfe", "aarch64": b"\x00\x00\x00\x14"}


def spin(pid: int) -> float:
    """The main thread of this process does nothing sensible from now on; when, seconds since 1970."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        words = Path(f"/proc/{pid}/syscall").read_text().split()
        if len(words) > 2:  # else it is running, and where changes while we look
            with Path(f"/proc/{pid}/mem").open("r+b", buffering=0) as memory:
                memory.seek(int(words[-1], 16))
                memory.write(_JUMP_TO_ITSELF[platform.machine()])
            return time.time()
    raise AssertionError(f"Process {pid} never waits.")
