"""A link at a real socket and a wearable that reaches it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from appliance.sensor.link import SensorLink, open_link
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
