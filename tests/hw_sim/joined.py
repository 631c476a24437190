"""Emulated sensors and the box's own link, joined on an invented clock: minutes of a show in a second."""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Collection, Iterator, Mapping, Sequence

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, SensorReading
from appliance.sensor.transports.transport import Origin
from hw_sim.device import Device, Lane
from hw_sim.emulator import Emulator, Sent
from hw_sim.motions import Quaternion
from hw_sim.network import VenueNetwork

TICK_S = 0.02


class Air:
    """An intake without a network: what devices put in comes out, answers go to the device that is meant."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.waiting: deque[tuple[bytes, float, Origin]] = deque()
        self.answers: dict[Origin, deque[bytes]] = defaultdict(deque)

    def receive_packets(self, now: float) -> Iterator[tuple[wire.Buffer, float, Origin]]:
        while self.waiting:
            yield self.waiting.popleft()

    def send_packet(self, packet: bytes, origin: Origin) -> None:
        self.answers[origin].append(packet)

    def reserve_sockets(self, origins: Collection[Origin]) -> None: ...

    def describe(self, origin: Origin) -> str:
        return str(origin)

    def close(self) -> None:
        self.waiting.clear()


class Show:
    """Devices, network and link on one clock; the box ticks every 20 ms, a datagram has its own arrival."""

    def __init__(
        self, devices: Sequence[Device], network: VenueNetwork, keys: Mapping[str, SensorKey]
    ) -> None:
        self.air = Air()
        self.keys = keys
        self.link = SensorLink(keys, [self.air])
        self.sent: dict[tuple[str, int, int], Sent] = {}
        self.made: dict[tuple[str, int], set[Quaternion]] = defaultdict(set)
        self.now = 1000.0
        senders = [{Lane.NETWORK: _Antenna(self, number)} for number in range(len(devices))]
        self.emulator = Emulator(
            devices, senders, network=network, on_sent=self._note, clock=lambda: self.now
        )
        self.emulator.start(self.now)
        self._tick = 0
        self._due = self.now

    def run(self, seconds: float) -> list[SensorReading]:
        """The readings that the box believed meanwhile."""
        readings: list[SensorReading] = []
        for _ in range(round(seconds / TICK_S)):
            self._tick += 1
            tick_at = 1000.007 + self._tick * TICK_S
            while self._due <= tick_at:
                self.now = self._due
                self._due = max(self.emulator.step(self.now), self.now + 1e-6)
            self.now = tick_at
            readings += self.link.drain(tick_at)
            self.link.send_due(tick_at)
            self._due = max(self.emulator.step(tick_at), tick_at + 1e-6)
        return readings

    def restart_box(self) -> None:
        """The box forgets everything; what is on the air stays there."""
        self.link = SensorLink(self.keys, [self.air])

    def _note(self, sent: Sent) -> None:
        sample = sent.sample
        self.sent[sample.sensor, sample.boot_nonce, sample.sequence] = sent
        self.made[sample.sensor, sample.sequence].add(sample.orientation)


class _Antenna:
    """One device's Sender into the air."""

    is_up = True
    descriptor = None

    def __init__(self, show: Show, number: int) -> None:
        self._show, self._number = show, number

    def send_packet(self, data: bytes) -> bool:
        self._show.air.waiting.append((data, self._show.now, self._number))
        return True

    def receive_packet(self) -> bytes | None:
        answers = self._show.air.answers[self._number]
        return answers.popleft() if answers else None

    def close(self) -> None: ...
