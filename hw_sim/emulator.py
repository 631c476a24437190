"""Wearables and the network between them and the box: makes packets, carries them, delivers them when due."""

from __future__ import annotations

import heapq
import select
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import NamedTuple, Protocol

from hw_sim.device import Device, Lane, Outgoing, Sample
from hw_sim.network import PERFECT, Delivery, VenueNetwork

LONGEST_SLEEP_S = 0.05  # a signal to stop is seen within this
IDLE_S = 0.006  # time that must be left for what is not urgent, such as a status line


class Sender(Protocol):
    """One lane of one device to the box, in both directions. Never waits, never raises."""

    @property
    def is_up(self) -> bool:
        """Whether the network is there, or the cable plugged in."""

    @property
    def descriptor(self) -> int | None:
        """File descriptor for select; None without one."""

    def send_packet(self, data: bytes) -> bool:
        """Send one packet. Returns whether it left."""

    def receive_packet(self) -> bytes | None:
        """The next packet from the box; None without one."""

    def close(self) -> None: ...


class Sent(NamedTuple):
    """A reading as it was sent."""

    sample: Sample
    sent_at: float  # read from the clock just before sending
    note: str  # "", reordered, duplicated, corrupted


class Emulator:
    """One to eight wearables on one network, each with its own senders to the box.

    `clock` and `sleep` replace the monotonic clock in tests; without `sleep` it receives while it waits.
    Use `run` in a separate thread or process, `start` and `step` in lockstep with something else.
    counts: packets sent, readings among them, unsent, and the network's effects on them.
    """

    def __init__(
        self,
        devices: Sequence[Device],
        senders: Sequence[Mapping[Lane, Sender]],
        *,
        network: VenueNetwork | None = None,
        on_sent: Callable[[Sent], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] | None = None,
    ) -> None:
        self.devices = tuple(devices)
        self.counts: Counter[str] = Counter()
        self._senders = tuple(senders)
        self._is_up = [dict.fromkeys(own, False) for own in senders]
        self._network = network or VenueNetwork(PERFECT, 0)
        self._on_sent = on_sent
        self._clock = clock
        self._sleep = sleep or self._listen
        self._to_the_box: list[tuple[float, int, int, Outgoing, str]] = []
        self._to_the_devices: list[tuple[float, int, int, Lane, bytes]] = []
        self._order = count()

    def start(self, now: float) -> None:
        """Switch all devices on."""
        for device in self.devices:
            device.start(now)

    def step(self, now: float) -> float:
        """Make, carry and deliver all that is due at `now`. Returns when the next is due."""
        for number in range(len(self.devices)):
            self._receive_from_box(number, now)
        while self._to_the_devices and self._to_the_devices[0][0] <= now:
            _, _, number, lane, data = heapq.heappop(self._to_the_devices)
            self.devices[number].receive_packet(data, now, lane)
        for number, device in enumerate(self.devices):
            for outgoing in device.step(now):
                self._carry(number, outgoing)
        while self._to_the_box and self._to_the_box[0][0] <= now:
            _, _, number, outgoing, note = heapq.heappop(self._to_the_box)
            self._send(number, outgoing, note)
        due = [device.next_at for device in self.devices]
        due += [waiting[0][0] for waiting in (self._to_the_box, self._to_the_devices) if waiting]
        return min(due)

    def run(
        self,
        seconds: float | None = None,
        should_stop: Callable[[], bool] = lambda: False,
        when_idle: Callable[[], None] = lambda: None,
    ) -> None:
        """Run in real time, on absolute deadlines, for `seconds` or until `should_stop`."""
        now = self._clock()
        end = now + seconds if seconds is not None else float("inf")
        self.start(now)
        while now < end and not should_stop():
            due = min(self.step(now), end)
            if due - self._clock() > IDLE_S:
                when_idle()
            wait_s = due - self._clock()
            if wait_s > 0:
                self._sleep(min(wait_s, LONGEST_SLEEP_S))
            now = self._clock()

    def close(self) -> None:
        """Close devices and senders."""
        for device in self.devices:
            device.close()
        for senders in self._senders:
            for sender in senders.values():
                sender.close()

    def _receive_from_box(self, number: int, now: float) -> None:
        """Carry what the box sent to one device; note a cable that came or went."""
        for lane, sender in self._senders[number].items():
            while (data := sender.receive_packet()) is not None:
                for delivery in self._carried(data, now, number, lane, to_box=False):
                    if delivery.note != "lost":
                        arrival = delivery.at, next(self._order), number, lane, delivery.data
                        heapq.heappush(self._to_the_devices, arrival)
            if sender.is_up != self._is_up[number][lane]:
                self._is_up[number][lane] = sender.is_up
                self.devices[number].connect(lane, sender.is_up, now)

    def _carry(self, number: int, outgoing: Outgoing) -> None:
        for delivery in self._carried(outgoing.data, outgoing.at, number, outgoing.lane, to_box=True):
            if delivery.note == "lost":
                self.counts["lost"] += 1
                continue
            carried = outgoing._replace(data=delivery.data)
            heapq.heappush(self._to_the_box, (delivery.at, next(self._order), number, carried, delivery.note))

    def _carried(self, data: bytes, at: float, number: int, lane: Lane, to_box: bool) -> list[Delivery]:
        """By the network; a cable loses nothing and holds nothing up."""
        if lane == Lane.CABLE:
            return [Delivery(at, data, "")]
        return self._network.carry(data, at, number, to_box)

    def _send(self, number: int, outgoing: Outgoing, note: str) -> None:
        sender = self._senders[number].get(outgoing.lane)
        sent_at = self._clock()
        if sender is None or not sender.send_packet(outgoing.data):
            self.counts["unsent"] += 1
            return
        self.counts["sent"] += 1
        if note:
            self.counts[note] += 1
        if outgoing.sample is not None:
            self.counts["readings"] += 1
            if self._on_sent is not None:
                self._on_sent(Sent(outgoing.sample, sent_at, note))

    def _listen(self, seconds: float) -> None:
        """Wait, but wake for a packet: the box's answers must not wait for a reading."""
        descriptors = (sender.descriptor for senders in self._senders for sender in senders.values())
        select.select([one for one in descriptors if one is not None], [], [], seconds)
