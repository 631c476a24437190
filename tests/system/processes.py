"""The processes of a box under test: started, heard, ended, and as the kernel lists them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Self, TypeVar

PATIENCE_S = 60.0  # for a machine that is busy with other things; nothing here waits without a reason
BUNRAKU = (sys.executable, "-m", "appliance.cli")

Found = TypeVar("Found")


def await_that(find: Callable[[], Found], missing: str | Callable[[], object] = "it never came") -> Found:
    """What `find` gives as soon as it gives something; fails after PATIENCE_S and says what is missing."""
    until = time.monotonic() + PATIENCE_S
    while not (found := find()):
        assert time.monotonic() < until, missing() if callable(missing) else missing
        time.sleep(0.02)
    return found


def started(command: Sequence[str], words: IO[bytes] | int) -> subprocess.Popen[bytes]:
    """A process whose words go into this file or terminal at once."""
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=words,
        stderr=subprocess.STDOUT,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


class Process:
    """One command of bunraku by itself, as systemd runs it. A context, which kills it."""

    def __init__(self, words_file: Path, *arguments: str, terminal: int | None = None) -> None:
        self.words_file = words_file
        self._command, self._terminal = (*BUNRAKU, *arguments), terminal
        self.start()

    def start(self) -> None:
        with self.words_file.open("ab") as words:
            self.process = started(self._command, words if self._terminal is None else self._terminal)

    @property
    def words(self) -> str:
        return self.words_file.read_text()

    def await_words(self, words: str) -> None:
        """Until it has said this."""
        await_that(lambda: words in self.words or self.process.poll() is not None, lambda: self.words)
        assert words in self.words, self.words

    def end(self, number: int = signal.SIGTERM) -> int:
        """Send a signal and give the exit status."""
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()


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
