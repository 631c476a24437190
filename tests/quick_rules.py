"""Plugin of `make test-quick`: a test that waits, loads PyTorch or starts an unusual program fails.

The listed tests (tests/quick.txt) run on any machine with .venv, without root and without Debian packages.
This plugin keeps them so: it watches the interpreter's audit events during each test. A test may start only
what every development machine has.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest

LONGEST_SLEEP_S = 0.1
PROGRAMS = {"bash", "sh", "git", "make", "true", "false", "cat", "sleep", "sha256sum"}  # besides .venv/bin
PROGRAMS |= {"ldconfig", "ld", "gcc", "cc"}  # ctypes.util.find_library asks them, and does without
_broken: list[str] = []


def program_of(command: object) -> str | None:
    """The name of a program that a rule forbids, or None."""
    words = command if isinstance(command, (list, tuple)) else [command]
    name = os.fsdecode(words[0]) if words and isinstance(words[0], (str, bytes, os.PathLike)) else ""
    is_ours = Path(name).is_absolute() and Path(name).parent == Path(sys.executable).parent
    is_python = Path(name).resolve() == Path(sys.executable).resolve()
    return None if is_ours or is_python or Path(name).name in PROGRAMS else name or "an unknown program"


def _watch(event: str, details: tuple[Any, ...]) -> None:
    if event == "subprocess.Popen" and (name := program_of(details[1])) is not None:
        _broken.append(f"starts {name}")
    elif event == "import" and details[0] == "torch":
        _broken.append("loads PyTorch")


def _sleep(seconds: float, sleep: Callable[[float], None] = time.sleep) -> None:
    if seconds > LONGEST_SLEEP_S:
        _broken.append(f"sleeps for {seconds:g} s")
    sleep(seconds)


def pytest_configure() -> None:
    """Watch this process; what a test starts is watched by its wall time only."""
    sys.addaudithook(_watch)
    time.sleep = _sleep  # type: ignore[assignment]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol() -> Generator[None, object, object]:
    _broken.clear()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    result = yield
    if _broken:
        broken = ", ".join(dict.fromkeys(_broken))
        pytest.fail(f"This test {broken}. Take {item.path.name} out of tests/quick.txt.", pytrace=False)
    return result
