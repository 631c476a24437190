"""The client of a running box's control port: sends a command from another process."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from appliance.box.served import from_here
from appliance.show.box import BoxConfig
from appliance.show_control.command import reply_to
from appliance.show_control.order_dispatch import PATIENCE_S as ERRAND_S
from appliance.show_control.packet import Message, datagram, messages_in, readable
from appliance.show_control.port import Address

PATIENCE_S = 2.0  # show control answers within 0.6 s, and later while it starts
_LARGEST_DATAGRAM = 4096


class NoBoxError(Exception):
    """No box answers; the message is for the user."""


@dataclass(frozen=True)
class Reply:
    """The box's reply: whether it was done, and a sentence."""

    done: bool
    message: str


class ControlClient:
    """The box behind a control port; each question opens its own socket."""

    def __init__(self, control: Address | None, patience_s: float = PATIENCE_S) -> None:
        self._control = control
        self._patience_s = patience_s

    @classmethod
    def of(cls, box: BoxConfig) -> ControlClient:
        """The box that plays with this box file on this machine."""
        control = box.control
        if control is None or control.port == 0:
            return cls(None)
        return cls((from_here(control.host), control.port))

    @property
    def has_port(self) -> bool:
        """Whether the box file gives it a control port."""
        return self._control is not None

    def ask(self, address: str, *arguments: str) -> Reply:
        """Send one command and return its answer. Raises NoBoxError.

        After the reply that it was not carried out in time a second one may follow; this waits for it.
        """
        answer, asked = None, time.monotonic()
        with contextlib.closing(self._replies((address, *arguments))) as replies:
            for about, values in replies:
                if about == reply_to(address) and len(values) == 3 and values[0] == address:
                    answer = Reply(bool(values[1]), readable(str(values[2])))
                    if answer.done or time.monotonic() - asked < ERRAND_S:  # refused, for good
                        return answer
        if answer is None:
            raise self._no_box()
        return answer

    def _replies(self, message: Message) -> Generator[tuple[str, list[Any]], None, None]:
        """Replies of the box until the timeout; none when no port is open there.

        The caller closes it: left to the garbage collector, its closing would swallow a Ctrl-C.
        """
        if self._control is None:
            return
        until = time.monotonic() + self._patience_s
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker, contextlib.suppress(OSError):
            asker.connect(self._control)  # so that a closed port is an error at once
            asker.send(datagram(message))
            while (left_s := until - time.monotonic()) > 0:
                asker.settimeout(left_s)
                received = asker.recv(_LARGEST_DATAGRAM)
                with contextlib.suppress(ValueError):  # not OSC: another program may use the port
                    yield from messages_in(received)

    def _no_box(self) -> NoBoxError:
        if self._control is None:
            return NoBoxError(
                "This box file has no control port that could be asked. Write `control: {port: 9002}` in it."
            )
        host, port = self._control
        return NoBoxError(f"No box answers on {host}:{port}.")
