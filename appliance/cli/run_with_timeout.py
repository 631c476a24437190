"""Doing something that may never end, in a process that is given up after a while."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import time
from collections.abc import Callable


class TimedOutError(Exception):
    """It gave nothing; the message says why."""


def within(seconds: float, do: Callable[[], bytes]) -> bytes:
    """What `do` gives, from a fork of this process; raises TimedOutError when it is late or has crashed.

    Whoever hangs in the kernel, on a stick that does not answer, cannot be ended: nobody waits for it.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        _answer(writing, do)
    with contextlib.suppress(OSError):
        os.setpgid(child, child)  # as it does itself, but perhaps not before its time is up
    os.close(writing)
    how = os.WNOHANG
    try:
        answer = _answered(reading, time.monotonic() + seconds, seconds)
        how = 0  # who has answered ends at once
    finally:
        os.close(reading)
        with contextlib.suppress(OSError):
            os.killpg(child, signal.SIGKILL)
        with contextlib.suppress(OSError):
            os.waitpid(child, how)
    return answer


def _answer(writing: int, do: Callable[[], bytes]) -> None:
    """In the fork; does not return."""
    status = 1
    try:
        os.setpgid(0, 0)  # what it starts is given up with it
        with os.fdopen(writing, "wb") as stream:
            stream.write(b"!" + do())
        status = 0
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        os._exit(status)


def _answered(reading: int, until: float, seconds: float) -> bytes:
    poll = select.poll()
    poll.register(reading, select.POLLIN)
    answer = b""
    while (left_s := until - time.monotonic()) > 0:
        if not poll.poll(1000.0 * left_s):
            break
        part = os.read(reading, 1 << 16)
        answer += part
        if not part:
            if answer.startswith(b"!"):
                return answer[1:]
            raise TimedOutError("what read it has crashed")
    raise TimedOutError(f"not within {seconds:g} s")
