"""Which serial port is the wearable: by the USB ids of its board; none and several are told apart."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.sensor.provisioning import serial_ports
from appliance.sensor.provisioning.serial_ports import FoundPort, NoWearableError, only_wearable

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
