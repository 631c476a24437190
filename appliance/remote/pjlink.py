"""PJLink class 1: switches projectors on and off, and keeps them so (JBMIA PJLink 1.04, TCP port 4352)."""

from __future__ import annotations

import contextlib
import hashlib
import socket
import threading
from collections.abc import Callable, Iterator
from typing import NamedTuple

PORT = 4352
_WITHIN_S = 5.0
LOOK_S = 15.0
_LONGEST = 136  # bytes of a line
_STATES = {"0": "off", "1": "on", "2": "cooling", "3": "warming"}
_ERRORS = ("fan", "lamp", "temperature", "cover", "filter", "other")
_REFUSED = {"ERR1": "knows no such command", "ERR2": "refuses", "ERR3": "is busy", "ERR4": "has failed"}


class PjLinkError(Exception):
    """The projector does not answer, or refuses; the message is a clause about it."""


class _EndedError(PjLinkError):
    """The connection is over."""


class Seen(NamedTuple):
    """state: off, on, cooling, warming, or unknown; trouble: a clause, "" where all is well."""

    state: str = "unknown"
    trouble: str = "was not asked yet"


def ask(host: str, port: int, password: str | None, *commands: str) -> list[str]:
    """The answers to commands like 'POWR ?', in one connection. Raises PjLinkError, OSError."""
    with _opened(host, port, password) as answer_to:
        return [answer_to(command) for command in commands]


@contextlib.contextmanager
def _opened(host: str, port: int, password: str | None) -> Iterator[Callable[[str], str]]:
    """A connection, as a function from a command to its answer. Both raise PjLinkError, OSError.

    After one that is refused the connection takes the next.
    """
    with socket.create_connection((host, port), _WITHIN_S) as one, one.makefile("rwb", buffering=0) as line:
        greeting = _line(line).split()
        if greeting[:1] != ["PJLINK"] or len(greeting) < 2:
            raise PjLinkError("speaks no PJLink")
        digest = ""
        if greeting[1] == "1":
            if len(greeting) < 3:
                raise PjLinkError("speaks no PJLink")
            if password is None:
                raise PjLinkError("asks for a password")
            digest = hashlib.md5((greeting[2] + password).encode(), usedforsecurity=False).hexdigest()

        def answer_to(command: str) -> str:
            nonlocal digest
            line.write(f"{digest}%1{command}\r".encode())
            digest = ""  # once a connection
            answer = _line(line)
            if answer == "PJLINK ERRA":
                raise PjLinkError("refuses the password")
            value = answer.partition("=")[2]
            if value in _REFUSED:
                raise PjLinkError(_REFUSED[value])
            return value

        yield answer_to


@contextlib.contextmanager
def _kept_open(host: str, port: int, password: str | None) -> Iterator[Callable[[str], str]]:
    """One connection for all commands: many take no second one for some seconds. Some end it after each."""
    with contextlib.ExitStack() as connection:
        answer_to = connection.enter_context(_opened(host, port, password))

        def answer_again_to(command: str) -> str:
            nonlocal answer_to
            try:
                return answer_to(command)
            except (ConnectionError, _EndedError):
                connection.close()
                answer_to = connection.enter_context(_opened(host, port, password))
                return answer_to(command)

        yield answer_again_to


def _line(line: socket.SocketIO) -> str:
    received = bytearray()
    while not received.endswith(b"\r"):
        byte = line.read(1)
        if not byte or len(received) > _LONGEST:
            raise _EndedError("ends the connection")
        received += byte
    return received[:-1].decode("ascii", "replace")


class ProjectorPower:
    """One projector, in a thread that asks it again and again, so that it also follows a power cut.

    wanted: True on, False off, None: as it is. One that went off and is switched on by hand stays on.
    """

    def __init__(
        self, host: str, port: int = PORT, password: str | None = None, look_s: float = LOOK_S
    ) -> None:
        self.host = host
        self.wanted: bool | None = None
        self.seen = Seen()
        self._port, self._password, self._look_s = port, password, look_s
        self._now, self._is_over, self._went_off = threading.Event(), False, False
        self._thread = threading.Thread(target=self._keep, name=f"projector {host}", daemon=True)
        self._thread.start()

    def want(self, on: bool) -> None:
        """Switch it, at once and from now on."""
        if on != self.wanted:
            self.wanted, self._went_off = on, False
            self._now.set()

    def close(self) -> None:
        """Let it be as it is."""
        self._is_over = True
        self._now.set()

    def _keep(self) -> None:
        while not self._is_over:
            self.seen = self._look()
            self._now.wait(self._look_s)
            self._now.clear()

    def _look(self) -> Seen:
        state = "unknown"
        try:
            with _kept_open(self.host, self._port, self._password) as answer_to:
                state = _STATES.get(answer_to("POWR ?"), "unknown")
                wanted = self.wanted
                if (state == "off" and wanted) or (state == "on" and wanted is False and not self._went_off):
                    answer_to(f"POWR {int(bool(wanted))}")
                    state = "warming" if wanted else "cooling"
                if wanted is False and state == "off":
                    self._went_off = True
                errors = _errors(answer_to, state)
        except PjLinkError as error:
            return Seen(state, str(error))
        except OSError as error:
            self._went_off = False  # after a power cut some go on by themselves
            return Seen(trouble=f"does not answer ({error.strerror or error})")
        faults = [name for name, level in zip(_ERRORS, errors, strict=False) if level == "2"]
        return Seen(state, f"reports a fault: {', '.join(faults)}" if faults else "")


def _errors(answer_to: Callable[[str], str], state: str) -> str:
    """A digit for each of _ERRORS; "" from one that does not tell them unless it is on."""
    try:
        return answer_to("ERST ?")
    except PjLinkError:
        if state == "on":
            raise
        return ""
