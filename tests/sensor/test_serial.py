"""Over a real pseudo-terminal: pairing, times, damage, and a cable that is pulled out and put in again."""

from __future__ import annotations

import json
import socket
import termios
import threading
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from appliance.sensor import framing, wire
from appliance.sensor.framing import frame
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.provisioning import serial_ports
from appliance.sensor.provisioning.serial_ports import FoundPort, NoWearableError, only_wearable
from appliance.sensor.transports.serial import UNSENT_PACKETS, SerialIntake
from appliance.sensor.transports.udp import UdpIntake
from tests.sensor.cable import PATIENCE_S, Cable, Plugged, await_reading, await_that, run_until
from tests.sensor.peers import KEYS, Wearable
from tools import generate_wire


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


def test_a_cable_that_is_pulled_out_while_it_is_opened_is_tried_again(
    cable: Cable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """pyserial lets termios.error through, which ended the thread and with it the cable."""
    flush, pulled = serial.Serial._reset_input_buffer, [termios.error(5, "Input/output error")]

    def flushed(port: serial.Serial) -> None:
        if pulled:
            raise pulled.pop()
        flush(port)

    monkeypatch.setattr(serial.Serial, "_reset_input_buffer", flushed)
    cable.plug_in()
    intake = SerialIntake(str(cable.name))
    await_that(lambda: intake.trouble is None)
    assert intake.counts["serial_error"] == 1
    intake.close()
    cable.pull_out()


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


WEARABLE, MODEM = FoundPort("/dev/ttyACM0", "", True), FoundPort("/dev/ttyS0", "a modem", False)
WAITING = FoundPort("/dev/ttyACM2", "", False, is_bootloader=True)


def test_the_only_wearable_is_found() -> None:
    assert only_wearable([MODEM, WEARABLE]) == "/dev/ttyACM0"


@pytest.mark.parametrize(
    ("ports", "message"),
    [
        ([], "no serial port at all"),
        ([MODEM], r"Serial ports here: /dev/ttyS0 \(a modem\)"),
        ([WEARABLE, MODEM, FoundPort("/dev/ttyACM1", "", True)], "2 wearables are plugged in"),
        ([WAITING], "waits for firmware: press its reset button once"),
    ],
)
def test_no_wearable_or_several_are_told(ports: list[FoundPort], message: str) -> None:
    with pytest.raises(NoWearableError, match=message):
        only_wearable(ports)


@pytest.mark.parametrize(("vendor", "product"), serial_ports.BOARDS)
def test_the_usb_ids_of_the_boards_are_known(
    monkeypatch: pytest.MonkeyPatch, vendor: int, product: int
) -> None:
    class Port:
        device, description, vid, pid = "/dev/ttyACM0", "n/a", vendor, product

    class Bootloader(Port):
        device, vid, pid = "/dev/ttyACM1", 0x2341, 0x004E

    monkeypatch.setattr(serial_ports.list_ports, "comports", lambda: [Bootloader, Port])
    first, second = serial_ports.found_ports()
    assert (first.is_wearable, second.is_wearable, second.is_bootloader) == (True, False, True)
    assert serial_ports.BOARDS[vendor, product] in str(first)


def test_the_box_lets_the_service_open_every_board_that_it_knows() -> None:
    rules = (Path(__file__).parents[2] / "deploy/system/usr/lib/udev/rules.d/60-bunraku.rules").read_text()
    for vendor, product in serial_ports.BOARDS:
        line = next(line for line in rules.splitlines() if f'idVendor}}=="{vendor:04x}"' in line)
        assert f"{product:04x}" in line


def test_packets_that_nobody_fetches_are_dropped_oldest_first(
    cable: Cable, opened: tuple[SensorLink, SerialIntake]
) -> None:
    link, intake = opened
    sensor = Plugged(cable)
    sensor.pair(link)
    for n in range(300):
        sensor.say(sensor.wearable.reading(degrees=n))
    await_that(lambda: intake.counts["serial_overrun"] >= 300 - 128)
    newest: list[int] = []

    def is_heard() -> bool:
        newest.extend(reading.sequence for reading in link.drain(time.monotonic()))
        return newest[-1:] == [300]

    await_that(is_heard)
    assert link.counts["accepted"] <= 129, "the oldest were heard"


def test_what_cannot_be_written_is_dropped_and_counted(cable: Cable) -> None:
    """Without a cable, and where nobody reads at the other end; reading goes on meanwhile."""
    intake = SerialIntake(str(cable.name))
    intake.send_packet(b"packet", ())
    assert intake.counts["send_error"] == 1
    cable.plug_in()
    await_that(lambda: intake.trouble is None)

    def stuff() -> bool:
        for _ in range(UNSENT_PACKETS):
            intake.send_packet(bytes(60), ())
        return intake.counts["send_error"] > UNSENT_PACKETS

    await_that(stuff)
    link = SensorLink(KEYS, [intake])
    cable.write(frame(Wearable(KEYS["head"]).hello()))
    await_that(lambda: link.drain(time.monotonic()) == () and link.counts["hello"] == 1)
    link.close()
    cable.pull_out()


def test_a_write_that_timed_out_as_the_thread_stood_still_drops_nothing_that_waits(cable: Cable) -> None:
    """pyserial looks at the time after its bytes have left, too."""
    intake = SerialIntake(str(cable.name))
    ours, theirs = socket.socketpair()
    with ours, theirs:
        port = TimedOut(ours)
        intake._unsent.append(b"next")
        intake._write(port, b"packet")
        assert (list(intake._unsent), intake.counts["send_error"]) == ([b"next"], 1)
        ours.setblocking(False)
        with suppress(BlockingIOError):  # nobody reads
            while True:
                ours.send(bytes(4096))
        intake._write(port, b"packet")
        assert (list(intake._unsent), intake.counts["send_error"]) == ([], 3)
    intake.close()


class TimedOut(serial.Serial):
    """A port whose writes come to no end in time."""

    def __init__(self, wire: socket.socket) -> None:
        super().__init__()
        self._wire = wire

    def fileno(self) -> int:
        return self._wire.fileno()

    def write(self, data: bytes) -> int:
        raise serial.SerialTimeoutException("Write timeout")


def test_a_device_that_never_opens_does_not_keep_the_box_from_ending(
    cable: Cable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a driver does whose device has died: the call does not come back."""
    is_opening, gives_way = threading.Event(), threading.Event()

    def dead(*_: object, **__: object) -> None:
        is_opening.set()
        gives_way.wait(PATIENCE_S)
        raise serial.SerialException("dead")

    monkeypatch.setattr(serial, "Serial", dead)
    intake = SerialIntake(str(cable.name))
    assert is_opening.wait(PATIENCE_S)
    closing = threading.Thread(target=intake.close, daemon=True)
    closing.start()
    closing.join(PATIENCE_S / 2)
    assert not closing.is_alive()
    gives_way.set()


def test_closing_ends_the_thread_with_and_without_a_cable(cable: Cable) -> None:
    absent = SerialIntake(str(cable.name))
    absent.close()
    cable.plug_in()
    present = SerialIntake(str(cable.name))
    await_that(lambda: present.trouble is None)
    present.close()
    assert not absent._thread.is_alive()
    assert not present._thread.is_alive()
    cable.pull_out()


payloads = st.binary(min_size=1, max_size=wire.LARGEST)


@given(st.binary(max_size=800))
def test_stuffing_leaves_no_zero_and_loses_nothing(data: bytes) -> None:
    stuffed = framing.cobs_encode(data)
    assert 0 not in stuffed
    assert framing.cobs_decode(stuffed) == data


@given(st.lists(payloads, max_size=6), st.integers(1, 40))
def test_packets_come_through_in_any_portions(packets: list[bytes], portion: int) -> None:
    stream = b"".join(framing.frame(packet) for packet in packets)
    deframer = framing.Deframer(Counter())
    came = [p for at in range(0, len(stream), portion) for p in deframer.feed(stream[at : at + portion])]
    assert came == packets
    assert not deframer.counts


@given(st.binary(max_size=300), payloads)
def test_garbage_before_a_frame_costs_at_most_that_frame(garbage: bytes, packet: bytes) -> None:
    deframer = framing.Deframer(Counter())
    deframer.feed(garbage)
    deframer.feed(framing.frame(packet))
    assert deframer.feed(framing.frame(packet)) == [packet]


@given(payloads, st.data())
def test_a_flipped_bit_never_passes(packet: bytes, data: st.DataObject) -> None:
    frame = bytearray(framing.frame(packet))
    bit = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    assert packet not in framing.Deframer(Counter()).feed(bytes(frame) + b"\x00")


def test_an_endless_line_without_a_zero_keeps_no_memory_and_is_counted_once() -> None:
    counts: Counter[str] = Counter()
    deframer = framing.Deframer(counts)
    for _ in range(1000):
        assert deframer.feed(b"\x55" * 100) == []
    assert len(deframer._rest) <= framing.LONGEST_FRAME
    deframer.feed(b"\x00")
    assert counts == {"frame_length": 1}
    assert deframer.feed(framing.frame(b"after")) == [b"after"]


def test_every_kind_of_damage_has_its_counter() -> None:
    counts: Counter[str] = Counter()
    deframer = framing.Deframer(counts)
    deframer.feed(b"\x00\x00\x00")
    assert not counts
    deframer.feed(b"\x09\x01\x00")
    deframer.feed(framing.cobs_encode(b"payload??") + b"\x00")
    deframer.feed(b"\x01" * 200 + b"\x00")
    assert counts == {"frame_stuffing": 1, "frame_crc": 1, "frame_length": 1}


def test_the_golden_frames() -> None:
    golden = json.loads(generate_wire.FRAMES.read_text(encoding="utf-8"))
    for vector in golden["frames"]:
        frame = bytes.fromhex(vector["frame"])
        assert framing.Deframer(Counter()).feed(frame) == [bytes.fromhex(vector["payload"])]
    # By hand: CRC-16/XMODEM of 0x01 is 0x1021; 01 21 10 holds no zero, so COBS puts 04 in front.
    assert framing.frame(b"\x01") == b"\x04\x01\x21\x10\x00"
