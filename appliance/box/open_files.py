"""How many files a process may have open: systemd and shells give few, and allow more."""

from __future__ import annotations

import contextlib
import resource

_ENOUGH = 4096


def open_more_files() -> None:
    """Raise this process's own limit as far as the system allows, up to what a box ever needs."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _ENOUGH if hard == resource.RLIM_INFINITY else min(_ENOUGH, hard)
    if soft != resource.RLIM_INFINITY and soft < most:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
