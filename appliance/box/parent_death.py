"""A child process ends when its parent ends, however that happens."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

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
