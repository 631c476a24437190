"""A desk that sends commands to the box and takes the replies; now and then it sends nonsense."""

from __future__ import annotations

import contextlib
import random
import socket
from collections import Counter
from typing import NamedTuple

from pythonosc.osc_message_builder import OscMessageBuilder

from hw_sim.osc_receiver import Argument, MalformedOscError, decode
from hw_sim.peers import HOST

_STATUS = "/bunraku/status/"
_WELL = (  # each of these restores what another one changed
    *(("/cue", ()), ("/cue", ()), ("/go", ()), ("/stop", (1.0,)), ("/go", ()), ("/blackout", (1,))),
    *(("/blackout", (0,)), ("/master", (0.3, 1.0)), ("/master", (1.0, 0.5)), ("/panic", ()), ("/go", ())),
    *(("/player/jump", (5.0,)), ("/player/rate", (1.5,)), ("/player/rate", (1.0,)), ("/status", ())),
    *(("/cues", ()), ("/hands", ()), ("/sensors/list", ()), ("/ping", ())),
    *(("/phrase", ("vary", 1.0)), ("/motion/again", ()), ("/phrase", ("improvise", 1.0)), ("/go", ())),
)
_ILL = (("/cue", ("no such cue",)), ("/nonsense", (1, "two")), ("/player/rate", (float("nan"),)))
_NONSENSE_EACH = 8


class Said(NamedTuple):
    """The stage's own counts, from its heartbeat."""

    late: int
    skipped: int
    tick_p50_ms: float


class Desk:
    """`counts`: sent, done, refused, garbage and heartbeats. `said`: the newest heartbeat's figures."""

    def __init__(self, seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self.said: Said | None = None
        self._random = random.Random(f"desk {seed}")
        self._place = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((HOST, 0))
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]

    def command(self, port: int) -> str:
        """Send the next command to this port of the box. Returns what it was."""
        self.counts["sent"] += 1
        if self.counts["sent"] % _NONSENSE_EACH == 0:
            return self._nonsense(port)
        address, arguments = _WELL[self._place % len(_WELL)]
        self._place += 1
        self._send(_message(address, arguments), port)
        return address

    def poll(self) -> None:
        """Take the replies."""
        while True:
            try:
                datagram = self._socket.recv(65536)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                continue  # show control was away when something was sent
            with contextlib.suppress(MalformedOscError):
                messages = decode(datagram)
                for address, arguments in messages:
                    self._take(address, arguments)
                self._take_heartbeat({address: arguments[0] for address, arguments in messages if arguments})

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _take(self, address: str, arguments: list[Argument]) -> None:
        if address in ("/reply", "/sensors/reply"):
            self.counts["done" if arguments[1] else "refused"] += 1

    def _take_heartbeat(self, values: dict[str, Argument]) -> None:
        late, skipped, p50_ms = (values.get(_STATUS + field) for field in Said._fields)
        if isinstance(late, int) and isinstance(skipped, int) and isinstance(p50_ms, float):
            self.counts["heartbeats"] += 1
            self.said = Said(late, skipped, p50_ms)

    def _nonsense(self, port: int) -> str:
        if self._random.random() < 0.5:
            self.counts["garbage"] += 1
            self._send(self._random.randbytes(self._random.randrange(1, 400)), port)
            return "garbage"
        address, arguments = self._random.choice(_ILL)
        self._send(_message(address, arguments), port)
        return f"{address} (wrong)"

    def _send(self, data: bytes, port: int) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendto(data, (HOST, port))


def _message(address: str, arguments: tuple[object, ...]) -> bytes:
    builder = OscMessageBuilder(address)
    for argument in arguments:
        builder.add_arg(argument)  # type: ignore[arg-type]
    return bytes(builder.build().dgram)
