"""Compiled wearables and the box's real link in shared virtual time, over real sockets."""

from __future__ import annotations

import random
import socket
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple
from unittest import mock

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, SensorReading, open_link
from hw_sim import motions
from hw_sim.emulated_sensor import sensor_axes
from hw_sim.firmware import NETWORK, PASSWORD, provision
from hw_sim.firmware_library import TO_ALL, CompiledWearable, State
from hw_sim.peers import HOST, free_ports

# Seconds of virtual time begin here: far from any machine's monotonic clock, so that the kernel's stamps on
# datagrams never look like times of this evening.
EPOCH_S = 1e8
STEP_S = 0.005
WAYPOINT_S = 0.01


class Measured(NamedTuple):
    """A reading as the wearable signed it, and the hand at that time."""

    orientation: motions.Quaternion  # as sent, sensor axes
    hand: motions.Quaternion  # true, sensor axes, but for the heading that the IMU started with
    at: float


class LockstepSensor:
    """One compiled wearable with its own UDP socket. Times are seconds of virtual time."""

    def __init__(self, key: SensorKey, motion: motions.Motion, seed: int, box_port: int) -> None:
        self.key = key
        self.motion = motion
        flash = provision(key, port=box_port, seed=seed)
        self.wearable = CompiledWearable(flash, seed=seed, start_us=round(EPOCH_S * 1e6))
        self.wearable.set_network(NETWORK, PASSWORD)
        self.measured: dict[tuple[int, int], Measured] = {}  # (boot nonce, sequence)
        self.lamp: list[tuple[float, bool]] = []  # each change: when, is on
        self.sent_to: Counter[tuple[str, int]] = Counter()  # unicast readings by receiver
        self._box = (HOST, box_port)
        self._waypoint = EPOCH_S
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((HOST, 0))
        self._socket.setblocking(False)

    @property
    def address(self) -> tuple[str, int]:
        address: tuple[str, int] = self._socket.getsockname()
        return address

    @property
    def state(self) -> State | None:
        """None: switched off."""
        status = self.wearable.status
        return State(status.state) if status.is_on else None

    def step(self, now: float) -> list[bytes]:
        """Receive, run to `now`, send; returns the datagrams from the box and to it, as on the air."""
        heard = []
        while (received := self._receive()) is not None:
            data, (host, port) = received
            self.wearable.put_datagram((int.from_bytes(socket.inet_aton(host), "big"), port), data)
            if port == self._box[1]:
                heard.append(data)
        while self._waypoint < now:
            self._waypoint += WAYPOINT_S
            hand = sensor_axes(self.motion(self._waypoint - EPOCH_S))
            self.wearable.go_to(hand, round(self._waypoint * 1e6))
        self.wearable.step_until(round(now * 1e6))
        self.lamp += ((at_us * 1e-6, is_on) for at_us, is_on in self.wearable.take_light())
        return heard + [self._send(*datagram) for datagram in self.wearable.take_datagrams()]

    def close(self) -> None:
        self._socket.close()
        self.wearable.close()

    def _receive(self) -> tuple[bytes, tuple[str, int]] | None:
        try:
            return self._socket.recvfrom(512)
        except BlockingIOError:
            return None

    def _send(self, at_us: int, address: tuple[int, int], data: bytes) -> bytes:
        ip, port = address
        to = self._box if ip == TO_ALL else (socket.inet_ntoa(ip.to_bytes(4, "big")), port)
        if data[3] == wire.READING.kind:
            self._remember(data)
            self.sent_to[to] += 1
        self._socket.sendto(data, to)
        return data

    def _remember(self, data: bytes) -> None:
        """Keep what the wearable measured, and the truth at that moment of its clock."""
        packet = wire.READING.decode(data)
        assert isinstance(packet, wire.Reading)
        at = (self.wearable.status.booted_at_us + packet.sensor_time_us) * 1e-6
        hand = sensor_axes(self.motion(at - EPOCH_S))
        self.measured[packet.boot_nonce, packet.sequence] = Measured(packet.orientation, hand, at)


@dataclass
class Accepted:
    """A reading that the link gave to the tick."""

    at: float
    reading: SensorReading


@dataclass
class Lockstep:
    """The wearables, the box, and listeners on the air; `run` advances them together."""

    sensors: list[LockstepSensor]
    port: int
    rng: random.Random
    tick_s: float = STEP_S
    now: float = EPOCH_S
    link: SensorLink | None = None  # None: the box is off
    accepted: list[Accepted] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)  # of links that were closed
    overheard: Callable[[bytes], None] = lambda data: None
    look: Callable[[float], None] = lambda now: None  # after each step

    def box_on(self) -> None:
        with mock.patch("secrets.token_bytes", self.rng.randbytes):  # the same seed: the same sessions
            self.link = open_link({one.key.name: one.key for one in self.sensors}, udp=(HOST, self.port))

    def box_off(self) -> None:
        assert self.link is not None, "the box is off already"
        self.counts.update(self.link.counts)
        self.link.close()
        self.link = None

    def access_point(self, is_on: bool, in_s: float = 0.0) -> None:
        """Switch it on or off in `in_s`: announced ahead, because a wearable may block while joining."""
        for sensor in self.sensors:
            sensor.wearable.set_access_point(is_on, round((self.now + in_s) * 1e6))

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Run for `seconds`, or until `until` holds; returns whether it did."""
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now = round(self.now + STEP_S, 6)
            for sensor in self.sensors:
                for data in sensor.step(self.now):
                    self.overheard(data)
            if self.link is not None and round(self.now / STEP_S) % round(self.tick_s / STEP_S) == 0:
                self.accepted += (Accepted(self.now, one) for one in self.link.drain(self.now))
                self.link.send_due(self.now)
            self.look(self.now)
            if until():
                return True
        return False


@contextmanager
def lockstep(
    names: list[str], seed: int, motion_of: Callable[[int], motions.Motion], tick_s: float = STEP_S
) -> Iterator[Lockstep]:
    """Provisioned wearables that are off, an access point that is on, a box that is off.

    tick_s: how often the box drains and sends, a multiple of STEP_S.
    """
    rng = random.Random(f"lockstep {seed}")
    [port] = free_ports(1)
    keys = [SensorKey(name, 0x5000 + number, rng.randbytes(16)) for number, name in enumerate(names)]
    sensors = [
        LockstepSensor(key, motion_of(number), 1000 * seed + number, port) for number, key in enumerate(keys)
    ]
    together = Lockstep(sensors, port, rng, tick_s)
    together.access_point(True)
    try:
        yield together
    finally:
        if together.link is not None:
            together.box_off()
        for sensor in sensors:
            sensor.close()
