"""A child process ends when its parent ends, however that happens; a fork that does one thing."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import sys
from collections.abc import Callable

PARENT = "BUNRAKU_PARENT"  # in the environment: the process to end with
REPORTED = "BUNRAKU_REPORTED"  # in the environment: the exit status of the try before, which has said why
_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """Call it first thing; does nothing in a process that a person or systemd started."""
    parent = os.environ.pop(PARENT, "")
    if not parent:
        return
    end_with(int(parent), signal.SIGTERM)


def end_with(parent: int, by: signal.Signals) -> None:
    """From now on this process ends by a signal when its parent ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, by, 0, 0, 0)
    if os.getppid() != parent:  # it ended while this one started
        sys.exit(0)


def was_reported(status: int) -> bool:
    """Whether the try before this one ended with the same status, and said why."""
    return os.environ.get(REPORTED) == str(status)


def forked(do: Callable[[], object]) -> int:
    """Run a function in a fork of this process, which is killed when this one ends; returns its number.

    Its status is 0 unless the function raised: that is printed. Raises OSError where there is no fork.
    """
    parent = os.getpid()
    if child := os.fork():
        return child
    status = 1
    try:
        gc.freeze()  # unused objects of the parent would close descriptors that are others by then
        end_with(parent, signal.SIGKILL)
        if log := sys.modules.get("logging"):
            log.getLogger().handlers = []  # their writing threads are not here
        do()
        status = 0
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        os._exit(status)
