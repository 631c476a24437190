"""Sensors on the network: sockets drained without waiting, each datagram with its true arrival."""

from __future__ import annotations

import errno
import select
import socket
import struct
import sys
import time
from collections import Counter
from collections.abc import Collection, Iterator
from typing import Any

from appliance.box.served import port_cure
from appliance.sensor import wire
from appliance.sensor.transports.transport import LONGEST_STOP_S, Origin

# Linux, include/uapi/asm-generic/socket.h: the kernel stamps each datagram as it comes in, on the wall clock.
SO_TIMESTAMPNS = 35
IP_FREEBIND = 15  # include/uapi/linux/in.h
TIMESPEC = struct.Struct("@qq")
OLDEST_S = 1.0
# The kernel counts about 768 bytes for one of our datagrams and doubles the size that is set.
COMMON_BUFFER_BYTES = 192 * 1024  # some 500 datagrams: two ticks of a heavy flood
OWN_BUFFER_BYTES = 192 * 1024  # some 500 datagrams: the burst of one sensor at 100 Hz after a stall of 5 s
# Limits of one drain: a flood costs 0.7 to 2.5 ms of a tick, depending on the machine.
COMMON_PER_DRAIN = 256
OWN_PER_DRAIN = 32
OWN_PER_SECOND = 128  # for each second without a drain: what a sensor sends, with some reserve


class PortError(OSError):
    """The port for the sensors cannot be opened; the message says what to do."""


class UdpIntake:
    """Listens on `host`:`port` (0: any free port, see `address`). Raises PortError when it cannot.

    A common socket receives from every address. A linked sensor has a separate socket, on the same port and
    connected to its address: the kernel puts its datagrams there, so a flood fills only the common one.
    """

    def __init__(self, host: str, port: int) -> None:
        self.counts: Counter[str] = Counter()
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except (OSError, OverflowError, UnicodeError) as error:
            raise PortError(_advice(host, port, error)) from error
        try:
            self._waits_for_address = not bind_early(self._socket, address)
        except OSError as error:
            self._socket.close()
            raise PortError(_advice(host, port, error)) from error
        self.has_stamps = _prepare(self._socket, COMMON_BUFFER_BYTES)
        if sys.platform == "linux":  # after bind: a second box must fail, our own sockets must not
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self._bound: Origin = self._socket.getsockname()
        # has_stamps: else a datagram counts as arrived when it is read, up to a tick late
        self.address: tuple[str, int] = (self._bound[0], self._bound[1])
        self.name = f"{self._bound[0]}:{self._bound[1]}"
        self._own: dict[Origin, socket.socket] = {}
        self._left: list[socket.socket] = []  # drained once more, then closed
        self._astray: set[Origin] = set()  # have a separate socket, but came in on the common one
        self._buffer = bytearray(2 * wire.LARGEST)  # longer datagrams are cut and have the wrong length
        self._view = memoryview(self._buffer)
        self._buffers = [self._buffer]
        self._ancillary_bytes = socket.CMSG_SPACE(TIMESPEC.size)
        self._monotonic_minus_wall = 0.0
        self._received_at: float | None = None
        self._oldest_s = OLDEST_S

    @property
    def address_is_absent(self) -> bool:
        """Whether this machine does not have the address (yet): no sensor is received until it does."""
        if self._waits_for_address:
            self._waits_for_address = not is_own(self.address[0])
        return self._waits_for_address

    def receive_packets(self, now: float) -> Iterator[tuple[wire.Buffer, float, Origin]]:
        """Waiting datagrams, their arrivals (monotonic seconds) and senders; linked sensors first.

        After a standstill it takes all that linked sensors sent meanwhile, because the newest counts.
        """
        self._compare_clocks()
        stop_s = 0.0 if self._received_at is None else min(max(0.0, now - self._received_at), LONGEST_STOP_S)
        self._received_at = now
        self._oldest_s = OLDEST_S + stop_s
        most = OWN_PER_DRAIN + int(OWN_PER_SECOND * stop_s)
        for own in self._own.values():
            yield from self._drain(own, most, now)
        while self._left:
            own = self._left.pop()
            yield from self._drain(own, most, now)
            own.close()
        for received in self._drain(self._socket, COMMON_PER_DRAIN, now):
            if received[2] in self._own:
                self._astray.add(received[2])
            yield received

    def await_packet(self, origin: Origin, seconds: float) -> None:
        """Wait for a datagram from this sender, in the kernel."""
        waiting = select.poll()
        waiting.register(self._own.get(origin, self._socket), select.POLLIN)
        waiting.poll(1000.0 * seconds)

    def send_packet(self, packet: bytes, origin: Origin) -> None:
        """Send one datagram from the listening port. Datagrams that cannot be sent at once are dropped and
        counted.
        """
        try:
            self._socket.sendto(packet, origin)
        except OSError:
            self.counts["send_error"] += 1

    def reserve_sockets(self, origins: Collection[Origin]) -> None:
        """Give each of exactly these senders a separate socket."""
        if sys.platform != "linux":
            return
        for origin in [one for one in self._own if one not in origins or one in self._astray]:
            self._left.append(self._own.pop(origin))
        self._astray.clear()
        for origin in origins:
            if origin not in self._own:
                try:
                    self._own[origin] = self._connected(origin)
                except OSError:
                    self.counts["socket_error"] += 1

    def describe(self, origin: Origin) -> str:
        return f"{origin[0]}:{origin[1]}"

    def close(self) -> None:
        for one in (self._socket, *self._own.values(), *self._left):
            one.close()

    def _connected(self, origin: Origin) -> socket.socket:
        own = socket.socket(self._socket.family, socket.SOCK_DGRAM)
        try:
            _prepare(own, OWN_BUFFER_BYTES)
            own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            own.bind(self._bound)
            own.connect(origin)
        except OSError:
            own.close()
            raise
        return own

    def _drain(
        self, one: socket.socket, most: int, now: float
    ) -> Iterator[tuple[wire.Buffer, float, Origin]]:
        for _ in range(most):
            try:
                length, ancillary, _, origin = one.recvmsg_into(self._buffers, self._ancillary_bytes)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                continue  # our answer was refused: the sensor is off; a forged refusal costs nothing
            except OSError:
                self.counts["socket_error"] += 1
                return
            yield self._view[:length], self._arrival(ancillary, now), origin
        self.counts["drain_limit"] += 1

    def _arrival(self, ancillary: list[tuple[int, int, bytes]], now: float) -> float:
        """The kernel's stamp on the box's clock; `now` without a stamp or after the wall clock was set.

        A datagram that came after the box read `now` keeps its later time.
        """
        if not ancillary or len(ancillary[0][2]) != TIMESPEC.size:
            return now
        seconds, nanoseconds = TIMESPEC.unpack(ancillary[0][2])
        arrival: float = seconds + nanoseconds * 1e-9 + self._monotonic_minus_wall
        if now - self._oldest_s < arrival < now:
            return arrival
        came_since = now <= arrival < now + LONGEST_STOP_S and arrival <= time.monotonic()
        return arrival if came_since else now

    def _compare_clocks(self) -> None:
        """Update the offset at each drain, because the wall clock may be set. The box may be held up between
        two of these readings, so the known offset is only clamped to their bounds.
        """
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        known = self._monotonic_minus_wall
        self._monotonic_minus_wall = min(max(known, before - wall), after - wall)


def bind_early(one: socket.socket, address: tuple[Any, ...]) -> bool:
    """Bind, even to an address that comes later (of an access point). Returns whether it is there now.

    IP_FREEBIND, ip(7). Raises OSError.
    """
    try:
        one.bind(address)
    except OSError as error:
        if error.errno != errno.EADDRNOTAVAIL or sys.platform != "linux":
            raise
        one.setsockopt(socket.IPPROTO_IP, IP_FREEBIND, 1)
        one.bind(address)
        return False
    return True


def is_own(host: str) -> bool:
    """Whether this machine has the address now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind((host, 0))
        except OSError as error:
            return error.errno != errno.EADDRNOTAVAIL
    return True


def _prepare(one: socket.socket, buffer_bytes: int) -> bool:
    """Whether the kernel stamps its datagrams; it need not (qemu's user mode does not)."""
    one.setblocking(False)
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
    try:
        one.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    except OSError:
        return False
    return sys.platform == "linux"


def _advice(host: str, port: int, error: Exception) -> str:
    known = error if isinstance(error, OSError) else OSError()
    return (
        f"UDP port {port} on {host} cannot be opened for sensors ({known.strerror or error}). "
        f"Nothing dances. {port_cure(known, 'sensors: udp')}"
    )
