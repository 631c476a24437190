"""A runtime folder with a stage, show control, and a client that asks; the two ends of an order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from appliance.box.orders import OrderInbox, OrderSender
from appliance.sensor.keys import create_keys
from appliance.show_control import order_dispatch
from tests.show_control.doubles import Asker, Clock, ControlInThread, StageDouble


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "runtime"
    folder.mkdir(mode=0o700)
    return folder


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "spare-1"])
    return tmp_path / "sensors.keys"


@pytest.fixture
def stage(folder: Path) -> Iterator[StageDouble]:
    with StageDouble(folder) as stage:
        yield stage


@pytest.fixture
def control(folder: Path, key_file: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ControlInThread]:
    """Its orders live while a busy machine may hold up a double; test_order_dispatch has the real time."""
    monkeypatch.setattr(order_dispatch, "PATIENCE_S", 15.0)
    control = ControlInThread(folder, key_file)
    yield control
    control.close()


@pytest.fixture
def asker(control: ControlInThread) -> Iterator[Asker]:
    asker = Asker(control.port)
    yield asker
    asker.close()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def sender(folder: Path) -> Iterator[OrderSender]:
    with closing(OrderSender(folder)) as sender:
        yield sender


@pytest.fixture
def inbox(folder: Path, clock: Clock) -> Iterator[OrderInbox]:
    with closing(OrderInbox(folder, "stage", clock)) as inbox:
        yield inbox
