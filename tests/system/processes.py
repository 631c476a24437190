"""The processes of a box under test: started, awaited, ended, and as the kernel lists them."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any, Self, TypeVar

import pytest

PATIENCE_S = 60.0  # for a busy machine; nothing waits that long without a fault
POLL_S = 0.02
BUNRAKU = (sys.executable, "-m", "appliance.cli")

Found = TypeVar("Found")


def wait_until(
    find: Callable[[], Found | None],
    missing: str | Callable[[], object] = "it never came",
    pause: Callable[[], object] | None = None,
    patience_s: float = PATIENCE_S,
) -> Found:
    """The first true value that `find` returns; fails after `patience_s` with what is missing.

    Without `pause` it waits at least as long as `find` took: what starts a process would else fill a core.
    """
    give_up = time.monotonic() + patience_s
    asked_at = time.monotonic()
    while not (found := find()):
        now = time.monotonic()
        assert now < give_up, missing() if callable(missing) else missing
        pause() if pause else time.sleep(max(POLL_S, now - asked_at))
        asked_at = time.monotonic()
    return found


def run(command: Sequence[str | Path], **options: Any) -> subprocess.CompletedProcess[str]:
    """One command, from start to end, with its output as text; fails after PATIENCE_S."""
    return subprocess.run(
        command, **{"capture_output": True, "text": True, "check": False, "timeout": PATIENCE_S} | options
    )


def run_bunraku(*arguments: str | Path, stdin: str = "") -> subprocess.CompletedProcess[str]:
    """One command of bunraku, from start to end, in this process: a new process costs half a second."""
    from appliance.cli.app import main  # here: importing it sets the environment of numerical libraries

    given, status = list(map(str, arguments)), 0
    with (
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()) as errors,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setattr(sys, "stdin", io.StringIO(stdin))
        try:
            main(given)
        except SystemExit as ended:
            status = int(ended.code or 0)
    return subprocess.CompletedProcess(given, status, out.getvalue(), errors.getvalue())


def start(command: Sequence[str | Path], output: IO[bytes] | int) -> subprocess.Popen[bytes]:
    """Start a process that writes to this file or terminal without a buffer."""
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


class Process:
    """A command with its output in a file, or on a terminal. A context, which kills it."""

    def __init__(self, output_file: Path, command: Sequence[str | Path], terminal: int | None = None) -> None:
        self.output_file, self.command, self._terminal = output_file, list(map(str, command)), terminal
        self.start()

    def start(self) -> None:
        with self.output_file.open("ab") as output:
            self.process = start(self.command, output if self._terminal is None else self._terminal)

    @property
    def output(self) -> str:
        """All output so far."""
        return self.output_file.read_text()

    def pause(self) -> None:
        """What to do between two looks at the output."""
        time.sleep(POLL_S)

    def await_output(self, message: str, count: int = 1) -> None:
        """Wait until the output has these words `count` times."""

        def has_it() -> bool:
            return self.output.count(message) >= count

        wait_until(
            lambda: has_it() or self.process.poll() is not None,
            lambda: f"'{message}' never came:\n{self.output}",
            self.pause,
        )
        assert has_it(), self.output

    def end(self, number: int = signal.SIGTERM) -> int:
        """Send a signal and return the exit status."""
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()


def children(pid: int) -> list[int]:
    """The living processes that this one has started."""
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):  # a thread that has just ended
            found += map(int, task.read_text().split())
    return found


def descendants(pid: int) -> list[int]:
    """The living processes that this one has started, those that they have started, and so on."""
    return [one for child in children(pid) for one in (child, *descendants(child))]


def is_running(pid: int) -> bool:
    """False once it has ended, even while nobody has asked for its exit status."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def has_argument(pid: int, word: str) -> bool:
    """Whether this word stands on the command line of a process; False once it has ended."""
    try:
        return word.encode() in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False


def children_running(pid: int, word: str) -> list[int]:
    """The children with this word on their command line."""
    return [child for child in children(pid) if has_argument(child, word)]
