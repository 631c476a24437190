"""Over real sockets: pairing, and ports and addresses that change or fail; nothing raises into the tick."""

from __future__ import annotations

import socket
import time

import pytest

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.transports import udp
from appliance.sensor.transports.udp import PortError, UdpIntake, is_own
from tests.sensor.peers import Wearable
from tests.sensor.radio import Radio, intake_of

PATIENCE_S = 20.0


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
    with pytest.raises(PortError, match="cannot be opened"):
        UdpIntake("no.such.host.invalid", 9750)


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
