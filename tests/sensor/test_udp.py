"""Over real sockets: pairing, and ports and addresses that change or fail; nothing raises into the tick."""

from __future__ import annotations

import errno
import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.transports import udp
from appliance.sensor.transports.udp import SO_TIMESTAMPNS, TIMESPEC, PortError, UdpIntake, is_own
from tests.sensor.flood import flood
from tests.sensor.peers import KEYS, Wearable
from tests.sensor.radio import Radio, intake_of

PATIENCE_S = 60.0


def test_a_sensor_pairs_over_the_network(link: SensorLink, radio: Radio) -> None:
    assert link.drain(time.monotonic()) == ()
    radio.pair(link)
    (state, _) = link.states(time.monotonic())
    assert state.state == "linked"
    assert state.way == f"127.0.0.1:{radio.socket.getsockname()[1]}"
    assert [type(packet) for packet in radio.hear()] == [wire.Heartbeat]


@pytest.mark.parametrize("data", [b"", b"\x00", b"BK", bytes(42), bytes(65_000)], ids=len)
def test_odd_sizes(link: SensorLink, radio: Radio, data: bytes) -> None:
    radio.pair(link)
    for _ in range(2):  # on the sensor's own socket
        radio.socket.send(data)
        radio.socket.send(radio.wearable.reading())
        assert [one.sequence for one in link.drain(time.monotonic())] == [radio.wearable.sequence]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:  # and on the common one
        stranger.sendto(data, intake_of(link).address)
        assert link.drain(time.monotonic()) == ()
    assert link.counts["length"] + link.counts["magic"] == 3


def test_a_longer_datagram_that_begins_like_a_reading_is_no_reading(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    radio.socket.send(radio.wearable.reading() + b"\x00")
    assert link.drain(time.monotonic()) == ()
    assert link.counts["length"] == 1


def test_a_sensor_that_changes_its_address_dances_on(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    for n in range(30):
        if n % 10 == 5:
            radio.move()
        radio.socket.send(radio.wearable.reading())
        assert [one.sequence for one in link.drain(time.monotonic())] == [radio.wearable.sequence]
        link.send_due(time.monotonic())
    assert list(intake_of(link)._own) == [radio.socket.getsockname()]
    assert link.counts["accepted"] == 31


def test_readings_that_wait_while_sockets_change_are_not_lost(link: SensorLink, radio: Radio) -> None:
    """On the common socket when the own one opens, and on the own one when it is left."""
    intake = intake_of(link)
    radio.pair(link)
    origin = radio.socket.getsockname()
    for attended in ((), (origin,), (), (origin,)):
        radio.socket.send(radio.wearable.reading())
        intake.reserve_sockets(attended)
        radio.socket.send(radio.wearable.reading())
        assert [one.sequence for one in link.drain(time.monotonic())] == [radio.wearable.sequence]
    assert link.counts["accepted"] == 7
    assert link.counts["reordered"] == 2  # from the common socket, after a newer one from the own
    assert not intake._left


def test_a_socket_that_its_sensor_does_not_reach_any_more_is_made_anew() -> None:
    """As when the box has got another address: what is sent there comes to the common socket."""
    intake = UdpIntake("0.0.0.0", 0)
    port = intake.address[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
        sensor.bind(("127.0.0.1", 0))
        origin = sensor.getsockname()
        intake.reserve_sockets([origin])
        own = intake._own[origin]
        sensor.sendto(b"to the address of before", ("127.0.0.1", port))
        sensor.sendto(b"to another one", ("127.0.0.2", port))
        assert [bytes(data) for data, *_ in intake.receive_packets(0.0)] == [
            b"to the address of before",
            b"to another one",
        ]
        intake.reserve_sockets([origin])
        assert intake._own[origin] is not own
    intake.close()


def test_answers_leave_from_the_listening_port(link: SensorLink, radio: Radio) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
        sensor.settimeout(PATIENCE_S)
        sensor.sendto(radio.wearable.hello(), intake_of(link).address)
        link.drain(time.monotonic())
        link.send_due(time.monotonic())
        _, whence = sensor.recvfrom(200)
    assert whence == intake_of(link).address


def test_a_taken_port_says_what_to_do_also_while_sensors_are_linked(link: SensorLink, radio: Radio) -> None:
    host, port = intake_of(link).address
    for _ in range(2):
        for taken in (host, "0.0.0.0"):
            with pytest.raises(PortError, match="Is a second bunraku running"):
                UdpIntake(taken, port)
        radio.pair(link)


def test_an_impossible_address_says_what_to_do() -> None:
    with pytest.raises(PortError, match="cannot be opened") as told:
        UdpIntake("no.such.host.invalid", 9750)
    assert "second bunraku" not in str(told.value), "no other box has the port"


def test_an_address_that_comes_later_is_listened_to(monkeypatch: pytest.MonkeyPatch) -> None:
    intake = UdpIntake("203.0.113.1", 0)
    assert intake.address_is_absent
    assert list(intake.receive_packets(time.monotonic())) == []
    monkeypatch.setattr(udp, "is_own", lambda host: True)
    assert not intake.address_is_absent
    intake.close()


def test_which_addresses_are_this_machines() -> None:
    assert is_own("127.0.0.1")
    assert not is_own("203.0.113.1")


def test_closed_sockets_never_raise_into_the_tick(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    intake = intake_of(link)
    for one in (intake._socket, *intake._own.values()):
        one.close()
    assert link.drain(time.monotonic()) == ()
    link.strobe("left-wrist", time.monotonic())
    link.send_due(time.monotonic())
    assert link.counts["socket_error"] == 2
    assert link.counts["send_error"] == 1


def test_an_answer_that_comes_back_keeps_no_reading_out(link: SensorLink, radio: Radio) -> None:
    """The sensor was switched off; the kernel tells so on its own socket, before what waits there."""
    radio.pair(link)
    port = radio.socket.getsockname()[1]
    radio.socket.close()
    link.strobe("left-wrist", time.monotonic())
    link.send_due(time.monotonic())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as again:
        again.bind(("127.0.0.1", port))
        again.sendto(radio.wearable.reading(), intake_of(link).address)
        assert [one.sequence for one in link.drain(time.monotonic())] == [2]
    assert "socket_error" not in link.counts


def test_an_answer_that_cannot_leave_is_counted() -> None:
    intake = UdpIntake("127.0.0.1", 0)
    intake.send_packet(b"x", ("203.0.113.1", 9))  # from loopback there is no way there
    intake.reserve_sockets([("203.0.113.1", 9)])
    assert intake.counts["send_error"] == 1
    assert intake.counts["socket_error"] == 1
    intake.close()


def test_no_sensors_no_port_no_trouble() -> None:
    link = open_link({}, udp=None)
    assert link.drain(0.0) == ()
    link.send_due(0.0)
    link.close()


def test_an_unknown_key_is_not_heard(link: SensorLink, radio: Radio) -> None:
    stranger = Wearable(SensorKey("stranger", 0x33, bytes(16)))
    radio.socket.send(stranger.hello())
    assert link.drain(time.monotonic()) == ()
    link.send_due(time.monotonic())
    assert link.counts["device"] == 1
    assert radio.hear() == []


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


def test_after_a_stop_the_newest_of_all_that_waits_counts(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    began = time.monotonic()
    link.drain(began)
    for _ in range(80):  # of 1.6 s
        radio.socket.send(radio.wearable.reading())
    assert [one.sequence for one in link.drain(began + 1.6)] == [radio.wearable.sequence]
    assert "drain_limit" not in link.counts


def test_a_tick_after_a_stop_takes_a_bounded_share_too(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    began = time.monotonic()
    link.drain(began)
    for after_s, most in ((0.02, 34), (1.03, 161), (1.05, 34)):
        for _ in range(200):
            radio.socket.send(radio.wearable.reading())
        before = link.counts["accepted"]
        link.drain(began + after_s)
        assert link.counts["accepted"] - before == most
        for _ in range(6):
            link.drain(began + after_s)  # the rest
        assert link.drain(began + after_s) == ()


def test_a_flood_takes_a_bounded_share_of_a_drain_and_passes(link: SensorLink, radio: Radio) -> None:
    radio.pair(link)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _ in range(3000):
            stranger.sendto(bytes(wire.READING.size), intake_of(link).address)
    radio.socket.send(radio.wearable.reading())
    before = link.counts["magic"]
    assert len(link.drain(time.monotonic())) == 1  # not behind the flood
    assert link.counts["magic"] - before == udp.COMMON_PER_DRAIN
    assert link.counts["drain_limit"] == 1
    drains = 0
    while (before := link.counts["magic"]) >= 0:
        link.drain(time.monotonic())
        drains += 1
        if link.counts["magic"] == before:
            break
    assert drains <= 4


@pytest.mark.realtime
def test_a_stranger_floods_while_a_sensor_dances_and_another_one_is_switched_on(
    link: SensorLink, radio: Radio
) -> None:
    """10,000 datagrams a second: noise, copies of what is on the air, forged hellos of known sensors."""
    radio.pair(link)
    late = Radio(intake_of(link).address, KEYS["head"])
    stranger = flood(intake_of(link).address, [Wearable(KEYS["left-wrist"]), Wearable(KEYS["head"], 9)], 2.0)
    sequences: list[int] = []
    hellos = 0
    tick = time.monotonic()
    while stranger.poll() is None:
        radio.socket.send(radio.wearable.reading())
        if late.wearable.session:
            late.socket.send(late.wearable.reading())
        elif len(sequences) % 25 == 24:
            late.socket.send(late.wearable.hello())
            hellos += 1
        newest = {reading.sensor: reading.sequence for reading in link.drain(time.monotonic())}
        link.send_due(time.monotonic())
        late.hear()
        sequences.append(newest["left-wrist"])
        tick += 0.02
        time.sleep(max(0.0, tick - time.monotonic()))
    assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))  # every one, in its tick
    assert late.wearable.session, f"none of {hellos} hellos came through"
    assert link.states(time.monotonic())[0].way.endswith(str(radio.socket.getsockname()[1]))
    late.socket.close()
