"""Commands by OSC: a small thread listens, checks each message, and lays it down for the tick to pick up."""

from __future__ import annotations

import math
import socket
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from pythonosc.osc_packet import OscPacket

_LARGEST_DATAGRAM = 4096
_PAUSE_S = 0.002  # after each datagram: a flood takes at most a few percent of the interpreter from the tick
_WAITING = 64  # commands that may wait for a tick; then the oldest gives way
_LISTEN_S = 0.1  # how soon the thread notices that the show is over


@dataclass(frozen=True, slots=True)
class Command:
    """One checked command: `name` as in the table below, its numbers, and the joint that it is about."""

    name: str
    values: tuple[float, ...] = ()
    joint: str | int = ""


@dataclass(frozen=True, slots=True)
class _Form:
    """How many numbers an address takes, and within which bounds."""

    name: str
    fewest: int = 0
    most: int = 0
    above: float = -1e6
    below: float = 1e6
    has_joint: bool = False


FORMS = {
    "/player/start": _Form("start"),
    "/player/stop": _Form("stop"),
    "/player/jump": _Form("jump", 1, 1, above=0.0),
    "/player/rate": _Form("rate", 1, 1, above=-4.0, below=4.0),
    "/player/excerpt": _Form("excerpt", 1, 2, above=0.0),
    "/iterations": _Form("iterations", 2, 2, above=0.0, below=64.0),
    "/mocap/setjointrot": _Form("hold", 4, 4, has_joint=True),
    "/mocap/releasejoint": _Form("release", 0, 0, has_joint=True),
}


def command(address: str, arguments: Sequence[object]) -> Command:
    """The command in one message. Raises ValueError with one clear sentence."""
    form = FORMS.get(address)
    if form is None:
        raise ValueError(f"{address} is no command of this box. It knows {', '.join(FORMS)}.")
    joint: str | int = ""
    if form.has_joint:
        if not arguments or not isinstance(arguments[0], str | int):
            raise ValueError(f"{address} begins with the joint: its name or its number.")
        joint, arguments = arguments[0], arguments[1:]
    numbers = [float(value) for value in arguments if isinstance(value, int | float)]
    if len(numbers) != len(arguments) or not form.fewest <= len(numbers) <= form.most:
        count = f"{form.fewest}" if form.fewest == form.most else f"{form.fewest} to {form.most}"
        raise ValueError(f"{address} takes {count} numbers.")
    if not all(math.isfinite(number) and form.above <= number <= form.below for number in numbers):
        raise ValueError(f"{address} takes numbers from {form.above:g} to {form.below:g}.")
    return Command(form.name, tuple(numbers), joint)


class Control:
    """The control port: commands wait in a queue until a tick takes them.

    Raises OSError when the port is taken. What is no command is counted in `refused`, with the last `reason`.
    """

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.settimeout(_LISTEN_S)
        self.port: int = self._socket.getsockname()[1]
        self.refused = 0
        self.reason = ""
        self._commands: deque[Command] = deque(maxlen=_WAITING)
        self._closing = False
        self._thread = threading.Thread(target=self._listen, name="control", daemon=True)
        self._thread.start()

    def take(self) -> Command | None:
        """The oldest command that waits, or None; never blocks."""
        return self._commands.popleft() if self._commands else None

    def close(self) -> None:
        """End the thread and free the port."""
        self._closing = True
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._closing:
            try:
                datagram = self._socket.recv(_LARGEST_DATAGRAM)
            except TimeoutError:
                continue
            self._read(datagram)
            time.sleep(_PAUSE_S)

    def _read(self, datagram: bytes) -> None:
        try:
            for timed in OscPacket(datagram).messages:
                self._commands.append(command(timed.message.address, timed.message.params))
        except Exception as error:  # python-osc raises many kinds; whatever came, the show goes on
            self.refused += 1
            self.reason = str(error)
