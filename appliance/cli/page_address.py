"""Where the page is served: its socket, and the address that browsers take."""

from __future__ import annotations

import errno
import os
import socket
from typing import TYPE_CHECKING

from appliance.box.served import listening, outward_host, port_cure
from appliance.stage.stage_error import StageError

if TYPE_CHECKING:
    from appliance.show.console import ConsoleConfig


def open_console_port(console: ConsoleConfig, or_any: bool = False) -> socket.socket:
    """The page's socket, listening. or_any: on a free port where the wanted one is taken.

    Raises StageError.
    """
    try:
        return listening(console.host, console.port)
    except OSError as error:
        if or_any and error.errno == errno.EADDRINUSE:
            return listening(console.host, 0)
        raise StageError(
            f"TCP port {console.port} on {console.host} cannot be opened for the page ({error.strerror}). "
            f"{port_cure(error, 'console')}"
        ) from error


def address_of(descriptor: int, https: bool = False) -> str:
    """The page's address, as a browser takes it."""
    with socket.socket(fileno=os.dup(descriptor)) as opened:
        host, port = opened.getsockname()[:2]
        return address(host, port, https)


def address(host: str, port: int, https: bool = False) -> str:
    """The same of a socket that listens on this host and port, or of a name."""
    if host in ("0.0.0.0", "::"):
        host = outward_host()
    return f"http{'s' * https}://{f'[{host}]' if ':' in host else host}:{port}"
