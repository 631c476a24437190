"""A child process: starts a command that ends with this process, and ends it within a time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import IO

from appliance.box.parent_death import PARENT

BUNRAKU = (sys.executable, "-m", "appliance.cli")

_KILLED_WITHIN_S = 1.0


def environment(base: Mapping[str, str] = os.environ, **more: str) -> dict[str, str]:
    """The environment of a child that ends when this process does."""
    return {**base, PARENT: str(os.getpid()), **more}


def finished(
    command: Sequence[str], within_s: float | None = None, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """A command that has ended, with its output. One that cannot be run or takes longer has a status other
    than 0, and the reason as its errors.
    """
    try:
        return subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=within_s, env=env, check=False
        )
    except subprocess.TimeoutExpired:
        status, why = os.EX_TEMPFAIL, f"{command[0]}: it took longer than {within_s:g} s"
    except OSError as error:
        status, why = os.EX_UNAVAILABLE, f"{command[0]}: {error.strerror}"
    return subprocess.CompletedProcess(command, status, "", why)


def start_child(
    command: Sequence[str],
    *,
    stdin: int = subprocess.DEVNULL,
    stdout: int | IO[bytes] | None = None,
    stderr: int | IO[bytes] | None = None,
    env: Mapping[str, str] | None = None,
    descriptors: Sequence[int] = (),
    has_own_session: bool = False,
) -> subprocess.Popen[bytes]:
    """Start a command. env: None is `environment()`; has_own_session: Ctrl-C does not reach it.

    descriptors: open files that it inherits. Raises OSError where it cannot be started.
    """
    return subprocess.Popen(
        command,
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        env=environment() if env is None else env,
        pass_fds=descriptors,
        start_new_session=has_own_session,
    )


def end_child(process: subprocess.Popen[bytes], within_s: float, by: signal.Signals = signal.SIGTERM) -> None:
    """Ask a child to end, and kill it after within_s seconds. One that hangs in the kernel is left behind."""
    process.send_signal(by)
    await_end(process, within_s)


def await_end(process: subprocess.Popen[bytes], within_s: float) -> None:
    """Wait for a child that was asked to end, and kill it after within_s seconds, as end_child does."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(within_s)
    process.kill()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(_KILLED_WITHIN_S)
