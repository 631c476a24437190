"""The processes of a box under test, as the kernel lists them."""

from __future__ import annotations

import contextlib
from pathlib import Path


def children(pid: int) -> list[int]:
    """The processes that this one has started and that live."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):  # a thread that has ended meanwhile
            found += map(int, task.read_text().split())
    return found


def says(pid: int, word: str) -> bool:
    """Whether its command line has this word; one that has ended has none."""
    try:
        return word.encode() in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False


def children_that_say(pid: int, word: str) -> list[int]:
    """Those of its children whose command line has this word."""
    return [child for child in children(pid) if says(child, word)]
