"""The emulator as a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest

Emulate = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def emulate() -> Iterator[Emulate]:
    """Starts it with these options; it does not outlive the test."""
    started: list[subprocess.Popen[str]] = []

    def start(*options: object) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "hw_sim", "emulate", *map(str, options)]
        started.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()
        if process.stderr is not None:
            process.stderr.close()
