"""The widget on a pseudo-terminal and its messages, seen from the other end of the cable."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
import serial

from hw_sim.dmx.usb_pro import GET_PARAMETERS, GET_SERIAL, SEND_DMX, UsbProWidget
from hw_sim.dmx.widget_message import Deframer, framed


def test_a_message_is_framed_as_the_manufacturer_s_document_says() -> None:
    assert framed(6, b"\0\x01\x02") == bytes.fromhex("7e 06 03 00 00 01 02 e7")
    assert framed(10, b"") == bytes.fromhex("7e 0a 00 00 e7")
    assert framed(6, bytes(513))[2:4] == b"\x01\x02"


@pytest.mark.parametrize("piece", [1, 2, 3, 7, 1000])
def test_messages_in_pieces(piece: int) -> None:
    stream = framed(6, bytes(513)) + framed(3, b"\0\0") + framed(6, b"\x7e\xe7" * 100)
    deframer, found = Deframer(), []
    for start in range(0, len(stream), piece):
        found += deframer.feed(stream[start : start + piece])
    assert found == [(6, bytes(513)), (3, b"\0\0"), (6, b"\x7e\xe7" * 100)]
    assert deframer.broken == 0


def test_a_message_is_found_after_garbage() -> None:
    dice = random.Random(3)
    for _ in range(300):
        garbage = bytes(dice.randrange(256) for _ in range(dice.randrange(1200)))
        deframer = Deframer()
        deframer.feed(garbage)
        found = [message for _ in range(3) for message in deframer.feed(framed(6, bytes(513)))]
        assert found[-1] == (6, bytes(513))


def test_it_answers_parameters_and_serial_number(tmp_path: Path) -> None:
    with (
        UsbProWidget(tmp_path / "ttyUSB0", serial_number=0x12345678) as widget,
        serial.Serial(str(widget.path), timeout=5) as port,
    ):
        port.write(framed(GET_PARAMETERS, b"\0\0"))
        assert port.read(10) == framed(3, bytes((44, 1, 9, 1, 40)))
        port.write(framed(GET_SERIAL, b""))
        assert port.read(9) == framed(10, bytes.fromhex("78563412"))
        port.write(framed(SEND_DMX, bytes(25)) + framed(GET_SERIAL, b""))
        port.read(9)
        assert widget.levels == bytes(24)
        for count in (24, 514):  # as the manufacturer's document says: 25 to 513
            port.write(framed(SEND_DMX, b"\1" * count) + framed(GET_SERIAL, b""))
            port.read(9)
            assert widget.levels == bytes(24)


def test_it_is_there_only_while_it_is_plugged_in(tmp_path: Path) -> None:
    widget = UsbProWidget(tmp_path / "ttyUSB0")
    assert not widget.path.exists()
    for _ in range(2):
        widget.plug_in()
        with serial.Serial(str(widget.path), timeout=5) as port:
            port.write(framed(GET_SERIAL, b""))
            assert port.read(1) == b"\x7e"
        widget.pull_out()
        assert not widget.path.exists()
    widget.pull_out()
