"""The real box with wearables that send twice a tick."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.box import playing
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime


def test_wearables_send_as_often_as_the_box_file_asks(show: Path, tmp_path: Path) -> None:
    with (
        playing(show, tmp_path, settings={"sensors": {"rate_hz": 100}}) as box,
        box.wearables() as wearables,
    ):
        box.await_output("neutral pose taken")
        wearables.dance()
        wait_until(lambda: box.listed_sensors()["left-wrist"]["rate_hz"] > 80, lambda: box.output)
        assert box.listed_sensors()["left-wrist"]["loss"] < 0.5
        assert box.end() == 0
