"""Run a function that may never end, in a process that is killed after a timeout."""

from __future__ import annotations

import contextlib
import os
import resource
import select
import signal
import time
from collections.abc import Callable

from appliance.box.parent_death import forked

CHECK_S = 30.0  # for a show: some seconds on a slow box
# The limit counts allocated memory: the default show with all its networks allocates 560 MB and uses 130. It
# stops a network that takes everything.
_OF_ALL_MEMORY, _LEAST_MEMORY_BYTES = 0.4, 800 << 20


class TimedOutError(Exception):
    """It gave no result; the message says why."""


def run_with_timeout(seconds: float, do: Callable[[], bytes]) -> bytes:
    """The result of `do`, run in a fork of this process; raises TimedOutError if it is late or crashes.

    A process that hangs in the kernel, on a dead stick for example, cannot be killed and is left behind.
    """
    reading, writing = os.pipe()
    child = forked(lambda: _answer(writing, do))
    with contextlib.suppress(OSError):
        os.setpgid(child, child)  # the child does the same, perhaps too late
    os.close(writing)
    how = os.WNOHANG
    try:
        answer = _answered(reading, time.monotonic() + seconds, seconds)
        how = 0  # a fork that has answered ends at once
    finally:
        os.close(reading)
        with contextlib.suppress(OSError):
            os.killpg(child, signal.SIGKILL)
        with contextlib.suppress(OSError):
            os.waitpid(child, how)
    return answer


def limit_memory() -> None:
    """Limit memory so that running out ends only this process, not the waiting one, nor the dance."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    most = max(_LEAST_MEMORY_BYTES, int(_OF_ALL_MEMORY * memory))
    with contextlib.suppress(OSError, ValueError):  # a lower limit holds already
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def _answer(writing: int, do: Callable[[], bytes]) -> None:
    """In the fork."""
    os.setpgid(0, 0)  # its own children are killed with it
    with os.fdopen(writing, "wb") as stream:
        stream.write(b"!" + do())


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
