"""More datagrams than a drain may take, after a stop or in a flood, keep no linked sensor out."""

from __future__ import annotations

import socket
import time

import pytest

from appliance.sensor import wire
from appliance.sensor.link import SensorLink
from appliance.sensor.transports import udp
from tests.sensor.flood import flood
from tests.sensor.peers import KEYS, Wearable
from tests.sensor.radio import Radio, intake_of


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
