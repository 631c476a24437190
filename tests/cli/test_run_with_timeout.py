"""A function that never ends is killed, also right at its start."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys

import pytest

from appliance.cli import run_with_timeout as run_with_timeout_module
from appliance.cli.run_with_timeout import TimedOutError, run_with_timeout
from appliance.release.choice import EMBEDDED_SHOW

PATIENCE_S = 60.0


def test_a_child_that_has_not_left_its_parent_s_group_is_ended_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine its time may be up before it has come to run at all."""
    set_group, fork, parent = os.setpgid, os.fork, os.getpid()
    children: list[int] = []

    def noted() -> int:
        children.append(fork())
        return children[-1]

    def never_comes_to_it(pid: int, group: int) -> None:
        if os.getpid() == parent:
            set_group(pid, group)
            return
        os.close(reading)
        while True:
            signal.pause()

    monkeypatch.setattr(os, "setpgid", never_comes_to_it)
    monkeypatch.setattr(os, "fork", noted)
    reading, writing = os.pipe()
    try:
        with pytest.raises(TimedOutError):
            run_with_timeout(0.05, lambda: b"never")
        os.close(writing)
        assert select.select([reading], [], [], PATIENCE_S)[0], "it lives on"
        assert os.read(reading, 1) == b""
    finally:
        os.close(reading)
        with contextlib.suppress(OSError):
            os.kill(children[0], signal.SIGKILL)


def test_the_default_show_fits_into_the_least_limit() -> None:
    """The limit of a computer with 2 GB, where shows with all their networks had been refused."""
    done = _check_with(run_with_timeout_module._LEAST_MEMORY_BYTES)
    assert done.returncode == 0, done.stderr


def test_a_lack_of_memory_is_not_taken_for_a_damaged_file() -> None:
    done = _check_with(300 << 20)
    assert done.returncode != 0
    assert "takes more memory" in done.stderr and "cannot be read" not in done.stderr


def _check_with(most_bytes: int) -> subprocess.CompletedProcess[str]:
    """`bunraku check` of the default show where a process may allocate so much."""
    command = ["prlimit", f"--data={most_bytes}", sys.executable, "-m", "appliance.cli", "check"]
    return subprocess.run([*command, "--show", str(EMBEDDED_SHOW)], capture_output=True, text=True)
