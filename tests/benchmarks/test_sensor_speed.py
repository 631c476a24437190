"""What sensors cost the tick: eight of them at 50 Hz, one alone, and ten seconds of a stranger's flood.

A tick has 20 ms: 0.4 ms of it are 2 % of a core.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.transports import udp
from tests.sensor.flood import flood
from tests.sensor.peers import KEYS, Wearable
from tests.sensor.radio import Radio, intake_of

TICK_S = 0.02
GROUP = "sensors, one tick: drain and answer"
EIGHT = KEYS | {f"hand-{n}": SensorKey(f"hand-{n}", 0x100 + n, bytes([n]) * 16) for n in range(6)}


@pytest.fixture
def link() -> Iterator[SensorLink]:
    link = open_link(EIGHT, udp=("127.0.0.1", 0))
    yield link
    link.close()


@pytest.fixture
def address(link: SensorLink) -> tuple[str, int]:
    return intake_of(link).address


class Hall:
    """Sensors that dance; one tick of the link on invented times, 20 ms apart."""

    def __init__(self, link: SensorLink, address: tuple[str, int], names: list[str]) -> None:
        self.link = link
        self.now = time.monotonic()
        self.ticks = 0
        self.radios = [Radio(address, EIGHT[name]) for name in names]
        for radio in self.radios:
            radio.pair(link)

    def readings(self) -> tuple[tuple[()], dict[str, object]]:
        self.now += TICK_S
        self.ticks += 1
        for radio in self.radios:
            radio.socket.send(radio.wearable.reading(degrees=2.0 * self.ticks))
        return (), {}

    def tick(self) -> None:
        self.link.drain(self.now)
        self.link.send_due(self.now)

    def close(self) -> None:
        for radio in self.radios:
            radio.socket.close()


@pytest.mark.parametrize("count", [8, 1])
def test_sensors_at_50_hz(
    measured: Callable[..., Any], link: SensorLink, address: tuple[str, int], count: int
) -> None:
    hall = Hall(link, address, list(EIGHT)[:count])
    benchmark = measured(f"{count} linked by network", GROUP)
    benchmark.pedantic(hall.tick, setup=hall.readings, rounds=2000)
    hall.close()
    assert link.counts["accepted"] == count * (hall.ticks + 1)


def test_the_worst_that_strangers_can_make_one_drain_cost(
    measured: Callable[..., Any], link: SensorLink, address: tuple[str, int]
) -> None:
    """Forged hellos of a known sensor: nothing but the tag is wrong."""
    forged = bytearray(Wearable(KEYS["head"]).hello())
    forged[-1] ^= 1

    def full_queue() -> tuple[tuple[()], dict[str, object]]:
        for _ in range(udp.COMMON_PER_DRAIN):
            stranger.sendto(forged, address)
        return (), {}

    benchmark = measured(f"{udp.COMMON_PER_DRAIN} forged hellos", GROUP)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        benchmark.pedantic(lambda: link.drain(time.monotonic()), setup=full_queue, rounds=300)
    assert link.counts["tag"] >= udp.COMMON_PER_DRAIN


def test_ten_seconds_of_flood(
    measured: Callable[..., Any], link: SensorLink, address: tuple[str, int]
) -> None:
    """10,000 datagrams a second, in true time. Each reading of the linked sensor is used in its own tick."""
    hall = Hall(link, address, ["left-wrist"])
    benchmark = measured("1 linked, 10,000 strange datagrams a second", GROUP)
    stranger = flood(address, [Wearable(KEYS["left-wrist"]), Wearable(KEYS["head"], 9)], seconds=10.0)
    used: list[int] = []

    def next_tick() -> tuple[tuple[()], dict[str, object]]:
        time.sleep(max(0.0, hall.now + TICK_S - time.monotonic()))
        return hall.readings()

    def tick() -> None:
        used.extend(reading.sequence for reading in link.drain(hall.now))
        link.send_due(hall.now)

    benchmark.pedantic(tick, setup=next_tick, rounds=500)
    stranger.kill()
    stranger.wait()
    hall.close()
    assert used == list(range(2, hall.ticks + 2))
    counts = link.counts
    benchmark.extra_info["strange datagrams"] = sum(counts.values()) - counts["accepted"]
