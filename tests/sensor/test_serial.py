"""Over a real pseudo-terminal: pairing, times, damage, and a cable that is pulled out and put in again."""

from __future__ import annotations

import socket
import time

from appliance.sensor import wire
from appliance.sensor.framing import frame
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.transports.serial import SerialIntake
from appliance.sensor.transports.udp import UdpIntake
from tests.sensor.cable import PATIENCE_S, Cable, Plugged, await_reading, await_that, run_until
from tests.sensor.peers import KEYS


def test_a_sensor_pairs_over_a_cable(cable: Cable, opened: tuple[SensorLink, SerialIntake]) -> None:
    link, _ = opened
    sensor = Plugged(cable)
    sensor.pair(link)
    sensor.say(sensor.wearable.reading())
    reading = await_reading(link)
    assert (reading.sensor, reading.sequence) == ("left-wrist", 1)
    assert reading.arrival <= time.monotonic()
    link.send_due(time.monotonic())
    (heartbeat,) = sensor.hear()
    assert isinstance(heartbeat, wire.Heartbeat)
    assert heartbeat.echo_sequence == 1
    (state, _) = link.states(time.monotonic())
    assert (state.state, state.way) == ("linked", str(cable.name))


def test_every_frame_stands_between_two_zero_bytes(
    cable: Cable, opened: tuple[SensorLink, SerialIntake]
) -> None:
    """So that half a line that a person typed, or half a frame, spoils nothing."""
    _, intake = opened
    intake.send_packet(b"packet", ())
    written = b""
    while len(written) < len(frame(b"packet")) + 1:
        written += cable.read()
    assert written == b"\x00" + frame(b"packet")


def test_damage_and_lines_for_people_between_frames(
    cable: Cable, opened: tuple[SensorLink, SerialIntake]
) -> None:
    link, _ = opened
    sensor = Plugged(cable)
    sensor.pair(link)
    cable.write(frame(sensor.wearable.reading())[7:] + b"ok saved\r\n")
    sensor.say(sensor.wearable.reading())
    assert await_reading(link).sequence == 2
    assert sum(count for reason, count in link.counts.items() if reason.startswith("frame_")) == 2


def test_unplugged_and_plugged_in_again(cable: Cable) -> None:
    intake = SerialIntake(str(cable.name))
    link = SensorLink(KEYS, [intake])
    await_that(lambda: "Plug it in" in (intake.trouble or ""))  # it is not there yet
    for boot in (1, 2):
        cable.plug_in()
        await_that(lambda: intake.trouble is None)
        link.sent.clear()
        sensor = Plugged(cable, boot=boot)
        sensor.pair(link)
        sensor.say(sensor.wearable.reading())
        assert await_reading(link).boot_nonce == boot
        cable.pull_out()
        await_that(lambda: intake.trouble is not None)
        assert link.drain(time.monotonic()) == ()
    assert link.counts["serial_error"] >= 3
    link.close()


def test_from_the_network_to_a_cable_and_back(cable: Cable) -> None:
    link = open_link(KEYS, udp=("127.0.0.1", 0), serial=[(str(cable.name), 115200)])
    network, intake = link.intakes
    assert isinstance(network, UdpIntake) and isinstance(intake, SerialIntake)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.connect(network.address)
        radio.settimeout(PATIENCE_S)
        cable.plug_in()
        await_that(lambda: intake.trouble is None)
        plugged = Plugged(cable)
        sensor = plugged.wearable
        ways, sessions = [], set()
        for by_cable in (False, True, False, True):
            say = plugged.say if by_cable else radio.send
            say(sensor.hello())
            assignments = link.sent["assignment"]
            run_until(link, lambda before=assignments: link.sent["assignment"] > before)  # type: ignore[misc]
            while not isinstance(
                plugged.hear()[-1] if by_cable else sensor.hear(radio.recv(200)), wire.Assignment
            ):
                pass
            for _ in range(3):
                say(sensor.reading())
                assert await_reading(link).sequence == sensor.sequence
            ways.append(link.states(time.monotonic())[0].way)
            sessions.add(sensor.session)
        address = f"127.0.0.1:{radio.getsockname()[1]}"
    assert ways == [address, str(cable.name)] * 2
    assert len(sessions) == 1
    assert link.counts["accepted"] == 12
    link.close()
    cable.pull_out()


def test_what_came_since_the_tick_read_its_time_came_when_it_did(cable: Cable) -> None:
    intake = SerialIntake(str(cable.name))
    intake._packets.extend([(b"before", 99.99), (b"since", 100.7), (b"on another clock", 7000.0)])
    assert [arrival for _, arrival, _ in intake.receive_packets(100.0)] == [99.99, 100.7, 100.0]
    intake.close()
