"""A function that never ends is killed, also right at its start."""

from __future__ import annotations

import contextlib
import os
import select
import signal

import pytest

from appliance.cli.run_with_timeout import TimedOutError, run_with_timeout

PATIENCE_S = 20.0


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
