"""Room for what a receiver has not read yet: a process that is held up loses nothing of what was sent."""

from __future__ import annotations

import socket

_SO_RCVBUFFORCE = 33  # Linux, asm-generic/socket.h: beyond net.core.rmem_max


def widen(one: socket.socket, size: int) -> None:
    """Give a socket a buffer of `size` bytes, or as many as it may have unprivileged."""
    try:
        one.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, size)
    except PermissionError:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
