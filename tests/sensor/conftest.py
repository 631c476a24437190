"""Links over a real socket and over a pseudo-terminal, and what reaches them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.sensor.link import SensorLink, open_link
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
