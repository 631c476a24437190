"""The box that commands about sensors ask."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.sensor.keys import create_keys
from tests.cli.running_box import LEFT, LOST, SPARE, RunningBox


@pytest.fixture
def box(tmp_path: Path) -> Iterator[RunningBox]:
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "head", "spare-1"])
    box = RunningBox(tmp_path)
    box.report_sensors(
        [LEFT, LOST, SPARE],
        lambda name: {"left-wrist": "wanted", "head": "kept"}.get(name, ""),
        time.monotonic(),
    )
    yield box
    box.close()
