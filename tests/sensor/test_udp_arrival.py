"""A datagram's arrival is when it came, whatever clocks and stops do meanwhile."""

from __future__ import annotations

import errno
import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from appliance.sensor.link import SensorLink
from appliance.sensor.transports import udp
from appliance.sensor.transports.udp import SO_TIMESTAMPNS, TIMESPEC, UdpIntake
from tests.sensor.radio import Radio

CLOCKS_S = 0.001  # the kernel stamps by its wall clock; the box works out the monotonic time


def test_arrival_is_when_it_came_and_not_when_it_was_fetched(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    for n in range(20):  # the kernel takes a moment to switch its stamps on after the first socket opened
        before = time.monotonic()
        radio.socket.send(radio.wearable.reading(degrees=n))
        after = time.monotonic()
        time.sleep(0.015)
        now = time.monotonic()
        (reading,) = link.drain(now)
        assert before - CLOCKS_S <= reading.arrival <= now + CLOCKS_S
        if reading.arrival <= after + 0.002:
            break
    else:
        pytest.fail("no datagram was stamped at its arrival")


def test_times_that_are_invented_are_kept(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    for now in (5.0, 1e9):
        radio.socket.send(radio.wearable.reading())
        (reading,) = link.drain(now)
        assert reading.arrival == now


def test_a_system_without_stamps_is_heard_at_the_time_of_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    class NoStamps(socket.socket):
        def setsockopt(self, *option: Any) -> None:
            if option[:2] == (socket.SOL_SOCKET, SO_TIMESTAMPNS):
                raise OSError(errno.ENOPROTOOPT, "Protocol not available")
            super().setsockopt(*option)

    monkeypatch.setattr(socket, "socket", NoStamps)
    intake = UdpIntake("127.0.0.1", 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(intake.address)
        sender.send(b"a packet")
        ((packet, arrival, origin),) = intake.receive_packets(1234.5)
        assert (bytes(packet), arrival) == (b"a packet", 1234.5)
        intake.reserve_sockets({origin})  # one of its own needs no stamps either
        sender.send(b"another")
        assert [bytes(packet) for packet, _, _ in intake.receive_packets(1234.6)] == [b"another"]
    assert not intake.has_stamps and not intake.counts
    intake.close()


class Clocks:
    """Both clocks of a box; it is held up for `held_up_s` before its wall clock is read."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.wall_minus_monotonic, self.held_up_s = 1000.0, 1.7e9, 0.0
        monkeypatch.setattr(udp, "time", SimpleNamespace(monotonic=lambda: self.now, time=self._wall))
        self.intake = UdpIntake("127.0.0.1", 0)

    def drain(self) -> None:
        assert list(self.intake.receive_packets(self.now)) == []

    def arrival(self, stamped: float, now: float) -> float:
        """What becomes of a datagram that the kernel stamped at this moment of the monotonic clock."""
        seconds = int(stamped + self.wall_minus_monotonic)
        nanoseconds = round((stamped + self.wall_minus_monotonic - seconds) * 1e9)
        reported = [(socket.SOL_SOCKET, SO_TIMESTAMPNS, TIMESPEC.pack(seconds, nanoseconds))]
        return self.intake._arrival(reported, now)

    def _wall(self) -> float:
        self.now += self.held_up_s
        return self.now + self.wall_minus_monotonic


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Iterator[Clocks]:
    clocks = Clocks(monkeypatch)
    clocks.drain()
    yield clocks
    clocks.intake.close()


@pytest.mark.parametrize("stop_s", [0.3, 1.5, 4.9])
def test_what_came_during_a_stop_came_when_it_did(clocks: Clocks, stop_s: float) -> None:
    """Also what is as old as the stop: read as new, it would be danced."""
    clocks.now += stop_s
    clocks.drain()
    now = clocks.now
    assert clocks.arrival(1000.01, now) == pytest.approx(1000.01, abs=1e-5)
    assert clocks.arrival(now - 0.02, now) == pytest.approx(now - 0.02, abs=1e-5)
    clocks.now += 0.02
    clocks.drain()  # and nothing of the stop is left
    assert clocks.arrival(clocks.now - 1.5, clocks.now) == clocks.now


def test_a_stop_after_the_tick_has_read_its_time_makes_nothing_older(clocks: Clocks) -> None:
    began = clocks.now
    clocks.now += 0.8
    assert clocks.arrival(began + 0.6, began) == pytest.approx(began + 0.6, abs=1e-5)
    assert clocks.arrival(began + 0.9, began) == began  # still to come: the wall clock was set


def test_a_stop_between_two_clocks_moves_no_arrival(clocks: Clocks) -> None:
    clocks.held_up_s = 0.5
    clocks.drain()
    clocks.held_up_s = 0.0
    assert clocks.arrival(clocks.now - 0.1, clocks.now) == pytest.approx(clocks.now - 0.1, abs=1e-5)


@pytest.mark.parametrize("held_up_s", [0.0, 0.05])
def test_a_wall_clock_that_is_set_is_followed(clocks: Clocks, held_up_s: float) -> None:
    for step_s in (3600.0, -0.3, -7200.0, 0.2):
        clocks.wall_minus_monotonic += step_s
        clocks.held_up_s = held_up_s
        clocks.drain()
        clocks.held_up_s = 0.0
        clocks.drain()
        assert clocks.arrival(clocks.now - 0.1, clocks.now) == pytest.approx(clocks.now - 0.1, abs=1e-5)
