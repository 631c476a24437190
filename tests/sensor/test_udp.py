"""Over a real socket: readings come with the kernel's time of arrival, nothing waits, nothing raises."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.udp import PortError, UdpIntake
from tests.sensor.test_link import KEYS, datagram


@pytest.fixture
def link() -> Iterator[SensorLink]:
    link = open_link(KEYS, udp=("127.0.0.1", 0))
    yield link
    link.close()


@pytest.fixture
def sensor(link: SensorLink) -> Iterator[socket.socket]:
    intake = link.intakes[0]
    assert isinstance(intake, UdpIntake)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
        sensor.connect(intake.address)
        yield sensor


def test_a_reading_over_the_network(link: SensorLink, sensor: socket.socket) -> None:
    assert link.drain(time.monotonic()) == ()
    sensor.send(datagram(1))
    (reading,) = link.drain(time.monotonic())
    assert (reading.sensor, reading.sequence) == ("left-wrist", 1)


def test_arrival_is_when_it_came_and_not_when_it_was_fetched(link: SensorLink, sensor: socket.socket) -> None:
    for n in range(20):  # the kernel takes a moment to switch its stamps on after the socket opened
        before = time.monotonic()
        sensor.send(datagram(n, degrees=n))
        after = time.monotonic()
        time.sleep(0.015)
        now = time.monotonic()
        (reading,) = link.drain(now)
        assert before - 0.001 <= reading.arrival <= now
        if reading.arrival <= after + 0.002:
            break
    else:
        pytest.fail("no datagram was stamped at its arrival")


def test_times_that_are_invented_are_kept(link: SensorLink, sensor: socket.socket) -> None:
    for n, now in enumerate((5.0, 1e9)):
        sensor.send(datagram(n))
        (reading,) = link.drain(now)
        assert reading.arrival == now


@pytest.mark.parametrize("data", [b"", b"\x00", b"BK", bytes(42), bytes(65_000)], ids=len)
def test_odd_sizes(link: SensorLink, sensor: socket.socket, data: bytes) -> None:
    sensor.send(data)
    sensor.send(datagram(1))
    assert [reading.sequence for reading in link.drain(time.monotonic())] == [1]
    assert sum(link.counts.values()) == 2


def test_a_longer_datagram_that_begins_like_a_reading_is_no_reading(
    link: SensorLink, sensor: socket.socket
) -> None:
    sensor.send(datagram(1) + b"\x00")
    assert link.drain(time.monotonic()) == ()
    assert link.counts["length"] == 1


def test_a_flood_keeps_the_newest_reading_at_most_a_few_drains_away(
    link: SensorLink, sensor: socket.socket
) -> None:
    for _ in range(3000):
        sensor.send(bytes(wire.READING.size))
    drains = 0
    while link.drain(time.monotonic()) or link.counts["drain_limit"] > drains:
        drains += 1
    assert drains < 5
    sensor.send(datagram(1))
    assert [reading.sequence for reading in link.drain(time.monotonic())] == [1]


def test_a_taken_port_says_what_to_do(link: SensorLink) -> None:
    intake = link.intakes[0]
    assert isinstance(intake, UdpIntake)
    with pytest.raises(PortError, match="Is a second bunraku running"):
        UdpIntake(*intake.address)


@pytest.mark.parametrize(("host", "port"), [("no.such.host.invalid", 9750), ("203.0.113.1", 9750)])
def test_an_impossible_address_says_what_to_do(host: str, port: int) -> None:
    with pytest.raises(PortError, match="cannot be opened"):
        UdpIntake(host, port)


def test_a_closed_socket_never_raises_into_the_tick(link: SensorLink) -> None:
    intake = link.intakes[0]
    assert isinstance(intake, UdpIntake)
    intake._socket.close()
    assert link.drain(time.monotonic()) == ()
    assert link.counts["socket_error"] == 1


def test_no_sensors_no_port_no_trouble() -> None:
    link = open_link({}, udp=None)
    assert link.drain(0.0) == ()
    link.close()


def test_an_unknown_key_is_not_heard(link: SensorLink, sensor: socket.socket) -> None:
    stranger = SensorKey("stranger", 0x33, bytes(16))
    reading = wire.Reading(stranger.device_id, 1, 0, 1, 0, (1.0, 0.0, 0.0, 0.0), 0, 0, 0, 0, 0, 0)
    sensor.send(wire.pack(reading, wire.Tagger(stranger.key)))
    assert link.drain(time.monotonic()) == ()
    assert link.counts["device"] == 1
