"""The PIN and the devices that gave it, in their file; what wrong PINs cost."""

from __future__ import annotations

import shutil
import stat
from pathlib import Path

from appliance.console.devices import (
    DIGITS,
    FREE_TRIES,
    LONG_DIGITS,
    MOST_DEVICES,
    MOST_WRONG,
    PAUSE_S,
    Devices,
    WrongPins,
)


def test_a_device_is_known_by_its_token_until_it_is_revoked(tmp_path: Path) -> None:
    devices = Devices(tmp_path / "kept.json")
    token = devices.remember("phone")
    known = devices.known(token)
    assert known is not None and known.name == "phone"
    assert devices.known(token + "0") is None and devices.known("") is None
    assert devices.revoke(known.id) and not devices.revoke(known.id)
    assert devices.known(token) is None


def test_pin_and_devices_outlive_the_process_and_are_private(tmp_path: Path) -> None:
    path = tmp_path / "state" / "kept.json"
    first = Devices(path)
    token = first.remember("phone")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert token not in path.read_text(), "who reads the file must not become the device"
    again = Devices(path)
    assert again.pin == first.pin and again.known(token)


def test_another_process_that_changes_the_pin_is_seen(tmp_path: Path) -> None:
    served, command = Devices(tmp_path / "kept.json"), Devices(tmp_path / "kept.json")
    token = served.remember("phone")
    pin = command.change_pin()
    assert served.pin == pin and served.known(token) is None


def test_a_spoilt_file_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "kept.json"
    for spoilt in (b"", b"{", b"[]", b'{"pin": 5, "devices": []}', b'{"pin": "12345x", "devices": []}'):
        path.write_bytes(spoilt)
        assert len(Devices(path).pin) == 6
        assert Devices(path).pin == Devices(path).pin


def test_there_is_room_for_a_number_of_devices(tmp_path: Path) -> None:
    devices = Devices(tmp_path / "kept.json")
    tokens = [devices.remember(str(number)) for number in range(MOST_DEVICES + 1)]
    assert devices.known(tokens[0]) is None and all(map(devices.known, tokens[1:]))


def test_wrong_pins_cost_their_address_a_minute() -> None:
    wrong = WrongPins()
    for _ in range(FREE_TRIES):
        assert wrong.wait_s("a", 100.0) == 0.0
        wrong.note("a", 100.0)
    assert wrong.wait_s("a", 130.0) == PAUSE_S - 30.0
    assert wrong.wait_s("b", 130.0) == 0.0, "another device may give the PIN meanwhile"
    assert wrong.wait_s("a", 100.0 + PAUSE_S + 1.0) == 0.0


def test_many_addresses_together_hold_up_no_other_one_but_ask_for_a_longer_pin(tmp_path: Path) -> None:
    wrong, devices = WrongPins(), Devices(tmp_path / "kept.json")
    token = devices.remember("phone")
    for number in range(MOST_WRONG):
        assert not wrong.are_too_many
        wrong.note(f"10.0.{number // 250}.{number % 250}", 5.0)
    assert wrong.wait_s("192.168.0.1", 5.0) == 0.0
    assert wrong.are_too_many
    assert devices.lengthen_pin() and not devices.lengthen_pin()
    assert len(Devices(tmp_path / "kept.json").pin) == LONG_DIGITS and devices.known(token)
    assert len(devices.change_pin()) == DIGITS


def test_a_folder_that_is_deleted_or_takes_nothing_shuts_no_device_out(tmp_path: Path) -> None:
    path = tmp_path / "state" / "kept.json"
    devices = Devices(path)
    first, pin = devices.remember("phone"), devices.pin
    shutil.rmtree(path.parent)
    second = devices.remember("laptop")
    assert devices.pin == pin and devices.known(first) and devices.known(second)
    assert Devices(path).known(second), "it is made again"
    shutil.rmtree(path.parent)
    path.parent.write_text("a file where the folder was")
    third = devices.remember("tablet")
    assert devices.pin == pin and all(map(devices.known, (first, second, third)))
    found = devices.known(first)
    assert found is not None and devices.revoke(found.id) and devices.known(first) is None
