"""Keyboards without a desktop: what the kernel writes for each key, read from pipes in place of devices."""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.projector import keyboards as module
from appliance.projector.keyboards import Key, Keyboards

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
    time.sleep(0.01)  # a folder's time stamp is as fine as the kernel's tick
    return Device(folder / name)


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


def test_devices_that_may_not_be_read(devices: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plugged(devices)

    def refused(*_: object) -> int:
        raise PermissionError

    with monkeypatch.context() as patched:
        patched.setattr(os, "open", refused)
        keyboards = Keyboards(devices)
    assert keyboards.is_refused


def test_a_pipe_is_no_keyboard(devices: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    plugged(devices)
    keyboards = Keyboards(devices)
    assert list(keyboards.pressed()) == [] and not keyboards.is_refused
