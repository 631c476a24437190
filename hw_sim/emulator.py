"""Wearables and the network between them and the box: readings are made, carried, and sent when due."""

from __future__ import annotations

import heapq
import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import count
from typing import NamedTuple

from hw_sim.emulated_sensor import EmulatedSensor, Sample
from hw_sim.network import PERFECT, VenueNetwork

LONGEST_SLEEP_S = 0.05  # a signal to stop is seen within this
ASLEEP_S = 0.5  # further behind than this and readings are left out instead of sent in a burst
IDLE_S = 0.006  # what is not urgent, such as a status line, is done when so much time is left


class Sent(NamedTuple):
    """A datagram as it was really sent, for whoever follows it."""

    sample: Sample
    sent_at: float  # read from the clock just before sending
    note: str  # "", reordered, duplicated, corrupted


class Emulator:
    """One to eight sensors on one network. `send` gets each datagram, and says whether it could send it.

    `clock` and `sleep` stand in for the monotonic clock in tests. For a thread or a process of its own use
    `run`; in step with something else use `start` and `step`.
    """

    def __init__(
        self,
        sensors: Sequence[EmulatedSensor],
        send: Callable[[bytes], bool],
        *,
        network: VenueNetwork | None = None,
        on_sent: Callable[[Sent], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.sensors = tuple(sensors)
        self.counts: Counter[str] = Counter()
        self._send = send
        self._network = network or VenueNetwork(PERFECT, 0)
        self._on_sent = on_sent
        self._clock = clock
        self._sleep = sleep
        self._on_the_way: list[tuple[float, int, bytes, str, Sample]] = []
        self._order = count()

    def start(self, now: float) -> None:
        """All sensors are switched on at `now`."""
        for sensor in self.sensors:
            sensor.start(now)

    def step(self, now: float) -> float:
        """Makes and sends all that is due at `now`; gives when something is due next."""
        for flow, sensor in enumerate(self.sensors):
            if now - sensor.next_at > ASLEEP_S:
                sensor.skip_to(now)
            while sensor.next_at <= now:
                self._put_on_the_way(flow, sensor.sample())
        while self._on_the_way and self._on_the_way[0][0] <= now:
            _, _, data, note, sample = heapq.heappop(self._on_the_way)
            self._send_one(data, note, sample)
        due = [sensor.next_at for sensor in self.sensors]
        if self._on_the_way:
            due.append(self._on_the_way[0][0])
        return min(due)

    def run(
        self,
        seconds: float | None = None,
        should_stop: Callable[[], bool] = lambda: False,
        when_idle: Callable[[], None] = lambda: None,
    ) -> None:
        """Sends in real time, on absolute deadlines, for `seconds` or until `should_stop`."""
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

    def _put_on_the_way(self, flow: int, sample: Sample) -> None:
        for delivery in self._network.carry(sample.datagram, sample.sampled_at, flow):
            if delivery.note == "lost":
                self.counts["lost"] += 1
                continue
            heapq.heappush(
                self._on_the_way, (delivery.at, next(self._order), delivery.data, delivery.note, sample)
            )

    def _send_one(self, data: bytes, note: str, sample: Sample) -> None:
        sent_at = self._clock()
        if not self._send(data):
            self.counts["unsent"] += 1
            return
        self.counts["sent"] += 1
        if note:
            self.counts[note] += 1
        if self._on_sent is not None:
            self._on_sent(Sent(sample, sent_at, note))
