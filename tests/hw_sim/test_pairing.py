"""The emulated sensor's side of pairing against a small box: found, lost, found again, on any way."""

from __future__ import annotations

from itertools import count

import pytest

from appliance.sensor import wire
from hw_sim import motions
from hw_sim.device import Lane
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.pairing import LOST_S, Pairing
from hw_sim.wearer import Wearer
from tests.hw_sim.tiny_box import KEY, Pair, TinyBox, hello_times, paired, readings


def test_hello_at_once_readings_when_the_imu_has_started() -> None:
    pair = paired(phase_s=0.013)
    pair.run(1.0)
    (first_hello,) = hello_times(pair)  # answered, so one is enough
    assert first_hello == pytest.approx(50.0, abs=0.001)
    first_reading = pair.box.of(wire.Reading)[0][0]
    assert first_reading == pytest.approx(50.713, abs=0.001)
    assert {reading.session for reading in readings(pair)} == {pair.box.session}
    assert [reading.sequence for reading in readings(pair)] == list(range(len(readings(pair))))
    hello = pair.box.of(wire.Hello)[0][1]
    assert isinstance(hello, wire.Hello)
    assert (hello.session, hello.wire_hash, len(hello.imu_id)) == (0, wire.WIRE_HASH, 16)


def test_without_an_answer_it_says_hello_each_half_second_and_streams_to_nobody() -> None:
    pair = paired()
    pair.box.answers = False
    pair.run(3.2)
    assert hello_times(pair) == pytest.approx([50.0 + 0.5 * n for n in range(7)], abs=0.01)
    assert readings(pair) == []
    assert pair.device.light == "looking"


def test_three_seconds_without_the_box_and_it_looks_for_it_again_and_keeps_its_session() -> None:
    pair = paired()
    pair.run(5.5)
    last_heard = pair.clock.now
    pair.box.answers = False
    pair.run(LOST_S + 0.7)
    hellos = [at for at in hello_times(pair) if at > last_heard]
    assert LOST_S - 1.0 < hellos[0] - last_heard < LOST_S + 0.05  # the last heartbeat was up to 1 s ago
    hello = pair.box.of(wire.Hello)[-1][1]
    assert hello.session == pair.box.session
    streamed = len(readings(pair))
    pair.run(1.0)
    assert len(readings(pair)) == streamed
    pair.box.answers = True
    pair.run(1.0)
    later = readings(pair)[streamed:]
    assert later[0].sequence == streamed  # rising over the whole power-on
    assert len(later) > 20


def test_a_box_started_anew_calls_and_readings_go_on_with_its_session() -> None:
    pair = paired()
    pair.run(3.0)
    before = len(readings(pair))
    pair.line.box = pair.box = TinyBox(session=0xBEEF)
    pair.run(0.2)
    assert 1 <= len(hello_times(pair)) <= 2
    heard = readings(pair)
    assert heard[0].session == 0x5E55
    assert heard[-1].session == 0xBEEF
    assert [reading.sequence for reading in heard] == list(range(before, before + len(heard)))


def test_calls_are_answered_at_most_five_times_a_second() -> None:
    pair = paired()
    pair.run(2.0)
    before = len(hello_times(pair))
    for _ in range(100):
        pair.line.inject(pair.box.call())
        pair.run(0.01)
    assert 4 <= len(hello_times(pair)) - before <= 6


def test_the_light_follows_assignment_and_heartbeat() -> None:
    pair = paired()
    assert pair.device.light == "looking"
    pair.box.led = wire.LED_SLOW
    pair.run(0.1)
    assert pair.device.light == "slow"
    pair.box.led = wire.LED_STROBE
    pair.run(1.2)
    assert pair.device.light == "strobe"


def test_the_next_power_on_draws_another_nonce_and_starts_from_zero() -> None:
    nonces = count(1)
    pair = paired(reboot_every_s=3.0, boot_nonce=lambda: next(nonces))
    pair.run(7.0)
    assert pair.device.reboots == 1
    boots: dict[int, list[tuple[float, wire.Packet]]] = {1: [], 2: []}
    for at, packet in pair.box.of(wire.Reading):
        boots[packet.boot_nonce].append((at, packet))
    assert boots[2][0][1].sequence == 0
    assert boots[2][0][0] - boots[1][-1][0] == pytest.approx(1.5 + 0.7, abs=0.03)
    assert pair.sent[-1].sample.power_on_at == pytest.approx(50.0 + 3.0 + 1.5)


def test_a_link_is_not_kept_by_assignments() -> None:
    """Within its session only heartbeats keep it: as in the firmware."""
    pairing = Pairing(1)
    pairing.connect(Lane.NETWORK, True, 0.0)
    for at, hello, led, is_taken in ((0.0, 0, wire.LED_ON, True), (2.0, 1, wire.LED_STROBE, False)):
        pairing.take_call(at, Lane.NETWORK)
        assert [sequence for _, _, sequence in pairing.due_hellos(at)] == [hello]
        answer = wire.Assignment(KEY.device_id, 1, 0x5E55, hello, hello, 0, 50, led)
        assert pairing.take_assignment(answer, at + 0.1, Lane.NETWORK) == is_taken
    assert pairing.led == wire.LED_ON and pairing.next_at == pytest.approx(0.1 + LOST_S)
    pairing.reading_sent(5, 2.2)
    pairing.take_heartbeat(wire.Heartbeat(KEY.device_id, 1, 0x5E55, 1, 5, 0, wire.LED_ON), 2.21)
    assert pairing.round_trip == 100
    assert pairing.due_hellos(2.21 + LOST_S) != []
    assert pairing.round_trip == wire.ROUND_TRIP_UNKNOWN, "it is that of the link"


class TestRoaming:
    """Between the network and a cable; the cable is preferred, the session stays."""

    def test_a_cable_plugged_in_takes_over_and_pulled_out_gives_back(self) -> None:
        pair = paired()
        pair.run(2.0)
        on_cable: list[bytes] = []
        pair.cable.passing_on = on_cable.append
        pair.cable.is_up = True
        pair.run(1.0)
        assert len(on_cable) >= 49
        heard = len(readings(pair))
        pair.cable.is_up = False
        pair.run(1.0)
        assert len(on_cable) <= 53
        assert len(readings(pair)) >= heard + 45
        assert {reading.session for reading in readings(pair)} == {pair.box.session}
        sequences = [reading.sequence for reading in readings(pair)]
        assert sequences == sorted(set(sequences))

    def test_a_link_by_cable_is_not_left_for_the_network(self) -> None:
        pair = paired()
        pair.cable.is_up = True
        pair.run(2.0)
        on_network: list[bytes] = []
        pair.line.passing_on = on_network.append
        pair.line.inject(pair.box.call())
        pair.run(1.0)
        assert len(on_network) == 1, "a hello, whose answer came by the network too"

    def test_a_cable_to_a_dumb_charger_does_not_stop_the_stream(self) -> None:
        pair = paired()
        pair.run(2.0)
        pair.cable.box = charger = TinyBox()
        charger.answers = False
        pair.cable.is_up = True
        pair.run(2.0)
        assert len(readings(pair)) == pytest.approx(165, abs=2)
        assert 3 <= len(charger.of(wire.Hello)) <= 5

    def test_a_cable_alone(self) -> None:
        sensor = EmulatedSensor(KEY, Wearer(motions.still()))
        pair = Pair(sensor)
        pair.line.is_up = False
        pair.cable.is_up = True
        pair.run(1.0)
        assert len(readings(pair)) == pytest.approx(15, abs=1)
        assert {sent.note for sent in pair.sent} == {""}
