"""A venue's Wi-Fi in numbers: when each datagram arrives, and which never do. Time is an argument.

The default reproduces a real 50 Hz Wi-Fi IMU: inter-arrival median 20.0 ms, 99th percentile 25 to 26 ms,
largest gaps 105 to 245 ms, 0.4 to 0.6 % of gaps over 30 ms, 0.7 to 1.8 % under 5 ms.
"""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class NetworkProfile:
    """The effects of a network on datagrams. Shares are of all datagrams, 0..1."""

    least_delay_s: float = 0.0
    jitter_s: float = 0.0  # mean of what is added to each delay, exponential
    hiccup_share: float = 0.0  # one datagram is held up on its own, a retry on the air
    hiccup_s: tuple[float, float] = (0.0, 0.0)
    # Mean time between stalls, 0: never. All that is sent in one comes in a burst at its end.
    stall_every_s: float = 0.0
    stall_s: tuple[float, float] = (0.0, 0.0)
    long_stall_each: int = 1  # every n-th stall is a long one
    long_stall_s: tuple[float, float] = (0.0, 0.0)
    loss_share: float = 0.0
    reordered_share: float = 0.0
    duplicated_share: float = 0.0
    corrupted_share: float = 0.0


PERFECT = NetworkProfile()
VENUE = NetworkProfile(
    least_delay_s=0.0015,
    jitter_s=0.0006,
    hiccup_share=0.009,
    hiccup_s=(0.004, 0.008),
    stall_every_s=4.2,
    stall_s=(0.032, 0.070),
    long_stall_each=8,
    long_stall_s=(0.110, 0.215),
    loss_share=0.0004,
)
BAD = NetworkProfile(
    least_delay_s=0.002,
    jitter_s=0.003,
    hiccup_share=0.05,
    hiccup_s=(0.005, 0.025),
    stall_every_s=2.0,
    stall_s=(0.040, 0.120),
    long_stall_each=5,
    long_stall_s=(0.150, 0.600),
    loss_share=0.03,
    reordered_share=0.02,
    duplicated_share=0.01,
    corrupted_share=0.01,
)
PROFILES = {"venue": VENUE, "perfect": PERFECT, "bad": BAD}
OVERTAKING_S = (0.022, 0.070)  # how late a reordered datagram comes: one to three are ahead of it
BETWEEN_STALLS_S = 0.3
IN_A_BURST_S = (0.0002, 0.0008)


class Delivery(NamedTuple):
    """One datagram on its way to the box: when it comes out of the network, and what happened to it."""

    at: float
    data: bytes
    note: str  # "", lost, reordered, duplicated, corrupted; a lost one is never sent


class VenueNetwork:
    """One network that all sensors share: it stalls for all at once. The same seed gives the same show."""

    def __init__(self, profile: NetworkProfile, seed: int) -> None:
        self.profile = profile
        self._random = random.Random(f"datagrams {seed}")
        self._random_back = random.Random(f"answers {seed}")
        self._stalls = random.Random(f"stalls {seed}")
        self._stalled: deque[tuple[float, float]] = deque(maxlen=2)  # a slower datagram looks further ahead
        self._begun = -1.0  # when the first datagram left
        self._stall_number = self._stalls.randrange(profile.long_stall_each)
        self._last: dict[tuple[int, bool], float] = {}

    def carry(self, data: bytes, now: float, flow: int = 0, to_box: bool = True) -> list[Delivery]:
        """The fate of a datagram sent at `now` (seconds, never going back) by the sensor number `flow`.

        Or to it by the box. Each flow and direction keeps its order, except for datagrams that are reordered
        on purpose; what the box says does not change what becomes of the sensors' datagrams.
        """
        profile, source = self.profile, self._random if to_box else self._random_back
        draw = source.random
        self._begun = now if self._begun < 0.0 else self._begun
        if draw() < profile.loss_share:
            return [Delivery(now, data, "lost")]
        at = now + self._delay_s(now, source)
        note = ""
        if draw() < profile.reordered_share:
            at += source.uniform(*OVERTAKING_S)
            note = "reordered"
        else:
            at = max(at, self._last.get((flow, to_box), 0.0) + self._burst_spacing_s(source))
            self._last[flow, to_box] = at
        if draw() < profile.corrupted_share:
            data, note = _corrupted(data, source), "corrupted"
        deliveries = [Delivery(at, data, note)]
        if draw() < profile.duplicated_share:
            deliveries.append(Delivery(at + source.uniform(*OVERTAKING_S), data, "duplicated"))
        return deliveries

    def _delay_s(self, now: float, source: random.Random) -> float:
        profile = self.profile
        delay_s = profile.least_delay_s
        if profile.jitter_s:
            delay_s += source.expovariate(1 / profile.jitter_s)
        if source.random() < profile.hiccup_share:
            delay_s += source.uniform(*profile.hiccup_s)
        if profile.stall_every_s:
            start, end = self._stall_near(now + delay_s)
            if start <= now + delay_s < end:
                delay_s = end - now
        return delay_s

    def _stall_near(self, moment: float) -> tuple[float, float]:
        """Start and end of the stall that is on at `moment`, or of the next one."""
        while not self._stalled or self._stalled[-1][1] <= moment:
            self._stalled.append(self._next_stall(self._stalled[-1][1] if self._stalled else self._begun))
        return next(stall for stall in self._stalled if stall[1] > moment)

    def _next_stall(self, after: float) -> tuple[float, float]:
        profile = self.profile
        start = (
            after
            + BETWEEN_STALLS_S
            + self._stalls.expovariate(1 / (profile.stall_every_s - BETWEEN_STALLS_S))
        )
        self._stall_number += 1
        is_long = self._stall_number % profile.long_stall_each == 0
        return start, start + self._stalls.uniform(*(profile.long_stall_s if is_long else profile.stall_s))

    def _burst_spacing_s(self, source: random.Random) -> float:
        return source.uniform(*IN_A_BURST_S) if self.profile.least_delay_s else 0.0


def _corrupted(data: bytes, source: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(source.randint(1, 3)):
        damaged[source.randrange(len(damaged))] ^= 1 << source.randrange(8)
    return bytes(damaged) if damaged != data else bytes([data[0] ^ 1]) + data[1:]
