"""Where packets come from and answers go to: what the network and the cables have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from typing import Any, Protocol, TypeAlias

from appliance.sensor import wire

LONGEST_STOP_S = 5.0  # a box that stood still for longer is not expected to make up for it

Origin: TypeAlias = tuple[Any, ...]  # whom an intake heard: (host, port) of a datagram, (device,) of a cable


class Intake(Protocol):
    """UdpIntake, SerialIntake. Nothing here waits or raises; troubles are counted."""

    name: str  # for people: host and port, or the device
    counts: Counter[str]

    def receive(self, now: float) -> Iterator[tuple[wire.Buffer, float, Origin]]:
        """What waits, up to a bound of the intake's own: packet, arrival (monotonic), whence.

        An arrival is after `now` where the box was held up since it read that time.
        A packet's bytes are valid until the next one.
        """
        ...

    def send(self, packet: bytes, origin: Origin) -> None: ...

    def attend(self, origins: Collection[Origin]) -> None:
        """Keep these apart from strangers: linked sensors are heard whatever else comes."""
        ...

    def describe(self, origin: Origin) -> str: ...

    def close(self) -> None: ...


Way: TypeAlias = tuple[Intake, Origin]
