"""Keyboards without a desktop: what the kernel writes for each key, read from pipes in place of devices."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.projector import keyboards as module
from appliance.projector.keyboards import Key, Keyboards
from appliance.projector.keys import HELP
from tests.show_control.doubles import Clock

Q, C, LEFT, SHIFT, A = 16, 46, 105, 42, 30
KEY, SYNC = 1, 0


@pytest.fixture(autouse=True)
def pipes_are_keyboards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "is_keyboard", lambda descriptor: True)


class Device:
    """A named pipe that events are written into, as the kernel does."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self.path = path
        self._writing = os.open(path, os.O_RDWR | os.O_NONBLOCK)

    def write(self, *events: tuple[int, int]) -> None:
        """Key codes with their values: 1 pressed, 2 repeats, 0 released."""
        for code, value in events:
            os.write(self._writing, struct.pack("@llHHi", 1, 2, KEY, code, value))
            os.write(self._writing, struct.pack("@llHHi", 1, 2, SYNC, 0, 0))

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self._writing)


@pytest.fixture
def devices(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "input"
    folder.mkdir()
    yield folder


def plugged(folder: Path, name: str = "event0") -> Device:
    """A device that was not there before; the folder's time tells, however coarse it is."""
    before, device = folder.stat().st_mtime_ns, Device(folder / name)
    os.utime(folder, ns=(before, before + 1_000_000))
    return device


class Refusals:
    """The kernel's door: shut, as before udev has seen a new device."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.is_shut, self.tries, self._open = True, 0, os.open
        monkeypatch.setattr(os, "open", self)

    def __call__(self, *arguments: Any) -> int:
        self.tries += 1
        if self.is_shut:
            raise PermissionError
        return self._open(*arguments)


def test_keys_with_shift_and_repeats(devices: Path) -> None:
    device = plugged(devices)
    keyboards = Keyboards(devices)
    device.write((C, 1), (C, 0), (SHIFT, 1), (LEFT, 1), (LEFT, 2), (SHIFT, 0), (LEFT, 2), (A, 1))
    assert list(keyboards.pressed()) == [Key("C"), Key("Left", True), Key("Left", True), Key("Left")]
    assert list(keyboards.pressed()) == []
    keyboards.close()


def test_a_keyboard_that_is_plugged_in_later_and_one_that_is_pulled(devices: Path) -> None:
    keyboards = Keyboards(devices)
    assert list(keyboards.pressed()) == []
    one = plugged(devices)
    list(keyboards.pressed())
    one.write((SHIFT, 1), (Q, 1))
    assert list(keyboards.pressed()) == [Key("Q", True)]
    one.unplug()
    list(keyboards.pressed())
    another = plugged(devices)
    list(keyboards.pressed())
    another.write((C, 1))
    assert list(keyboards.pressed()) == [Key("C")]
    keyboards.close()


def test_no_devices_at_all(tmp_path: Path) -> None:
    keyboards = Keyboards(tmp_path / "nothing")
    assert list(keyboards.pressed()) == [] and not keyboards.is_refused


def test_devices_without_read_permission(devices: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plugged(devices)

    def refused(*_: object) -> int:
        raise PermissionError

    with monkeypatch.context() as patched:
        patched.setattr(os, "open", refused)
        keyboards = Keyboards(devices)
    assert keyboards.is_refused


def test_a_device_that_is_opened_to_this_user_a_little_later(
    devices: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel makes it for root alone; udev's next touch does not change the folder."""
    clock = Clock()
    keyboards = Keyboards(devices, monotonic=clock)
    device = plugged(devices)
    door = Refusals(monkeypatch)
    for _ in range(60):
        assert list(keyboards.pressed()) == []
        clock.now += 0.1
    assert 8 <= door.tries <= 16
    door.is_shut = False
    clock.now += 0.5
    list(keyboards.pressed())
    device.write((C, 1))
    assert list(keyboards.pressed()) == [Key("C")]
    keyboards.close()


def test_what_is_no_keyboard_is_left_alone_while_another_device_is_refused(
    devices: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each look is in the middle of the pictures."""
    clock, tries, real = Clock(), [], os.open

    def tried(path: Path, *flags: int) -> int:
        tries.append(path.name)
        if path.name == "event0":
            raise PermissionError
        return real(path, *flags)

    monkeypatch.setattr(module, "is_keyboard", lambda _: False)
    plugged(devices, "event0")
    plugged(devices, "event1")
    monkeypatch.setattr(os, "open", tried)
    keyboards = Keyboards(devices, monotonic=clock)
    for _ in range(60):
        list(keyboards.pressed())
        clock.now += 0.1
    assert tries.count("event0") >= 8
    assert tries.count("event1") == 2  # once more when the folder has settled
    monkeypatch.setattr(module, "is_keyboard", lambda _: True)
    os.utime(devices, ns=(0, devices.stat().st_mtime_ns + 1_000_000))
    list(keyboards.pressed())
    assert tries.count("event1") == 3
    keyboards.close()


def test_a_second_device_within_the_same_tick_of_the_kernel(devices: Path) -> None:
    clock = Clock()
    keyboards = Keyboards(devices, monotonic=clock)
    plugged(devices, "event0")
    list(keyboards.pressed())
    tick = devices.stat().st_mtime_ns
    second = Device(devices / "event1")
    os.utime(devices, ns=(tick, tick))
    clock.now += 1.0
    list(keyboards.pressed())
    second.write((C, 1))
    assert list(keyboards.pressed()) == [Key("C")]
    keyboards.close()


def test_a_pipe_is_no_keyboard(devices: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    plugged(devices)
    keyboards = Keyboards(devices)
    assert list(keyboards.pressed()) == [] and not keyboards.is_refused


def test_each_key_of_the_list_is_known_without_a_desktop() -> None:
    """The list that `h` prints; + is the key = with Shift, and there is one on the keypad."""
    listed = {word for line in HELP.splitlines() for word in line[:12].split()} - {"arrows", "+", "Esc"}
    names = {name.upper() if len(name) == 1 else name for name in listed}
    assert names | {"Left", "Right", "Up", "Down", "=", "Keypad +", "Escape"} <= set(module._NAMES.values())
