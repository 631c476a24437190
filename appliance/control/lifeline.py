"""The lifeline: a process that another one started ends when that one ends, however that happens."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

PARENT = "BUNRAKU_PARENT"  # in the environment: the process to end with
_PR_SET_PDEATHSIG = 1


def hold_lifeline() -> None:
    """Call it first thing; does nothing in a process that a person or systemd started."""
    parent = os.environ.pop(PARENT, "")
    if not parent:
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if os.getppid() != int(parent):  # it ended while this one started
        sys.exit(0)
