"""The common interface of network and cables: packets come in, answers go out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from typing import Any, Protocol, TypeAlias

from appliance.sensor import wire

LONGEST_STOP_S = 5.0  # after a longer standstill the box does not catch up

Origin: TypeAlias = tuple[Any, ...]  # origin of a packet: (host, port) of a datagram, (device,) of a cable


class Intake(Protocol):
    """UdpIntake, SerialIntake. Waits only where it says so, never raises; errors are counted."""

    name: str  # in messages: host and port, or the device
    counts: Counter[str]

    def receive_packets(self, now: float) -> Iterator[tuple[wire.Buffer, float, Origin]]:
        """Waiting packets, up to the intake's own bound: packet, arrival (monotonic), origin.

        An arrival may be after `now` when the box was held up since it read the clock.
        A packet's bytes are valid until the next packet.
        """
        ...

    def await_packet(self, origin: Origin, seconds: float) -> None:
        """Wait for a packet from this origin, `seconds` at most. Another packet may end the wait."""
        ...

    def send_packet(self, packet: bytes, origin: Origin) -> None: ...

    def reserve_sockets(self, origins: Collection[Origin]) -> None:
        """Give each of these origins a separate socket, which a flood from others cannot fill."""
        ...

    def describe(self, origin: Origin) -> str: ...

    def close(self) -> None: ...


Route: TypeAlias = tuple[Intake, Origin]
