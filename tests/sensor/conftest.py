"""Links over a real socket and a pseudo-terminal, what reaches them, and a console that settles at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.provisioning import wearable_console
from appliance.sensor.transports.serial import SerialIntake
from tests.sensor.cable import Cable, await_that
from tests.sensor.peers import KEYS
from tests.sensor.radio import Radio, intake_of


@pytest.fixture
def link() -> Iterator[SensorLink]:
    link = open_link(KEYS, udp=("127.0.0.1", 0))
    yield link
    link.close()


@pytest.fixture
def radio(link: SensorLink) -> Iterator[Radio]:
    radio = Radio(intake_of(link).address)
    yield radio
    radio.socket.close()


@pytest.fixture
def cable(tmp_path: Path) -> Cable:
    return Cable(tmp_path / "sensor")


@pytest.fixture
def opened(cable: Cable) -> Iterator[tuple[SensorLink, SerialIntake]]:
    """A link over the plugged cable, and its intake."""
    cable.plug_in()
    link = open_link(KEYS, serial=[(str(cable.name), 115200)])
    (intake,) = link.intakes
    assert isinstance(intake, SerialIntake)
    await_that(lambda: intake.trouble is None)
    yield link, intake
    link.close()
    cable.pull_out()


@pytest.fixture
def short_settling(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wearable of these tests answers at once, and each question was asked once."""
    monkeypatch.setattr(wearable_console, "_QUIET_S", 0.02)
