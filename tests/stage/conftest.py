"""An evening on which sensors are put on, and what the box remembers of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import write_show
from tests.stage.worn import HAND, Evening, Stage


@pytest.fixture
def memory() -> SensorMemory:
    return SensorMemory(None, print)


@pytest.fixture
def evening(tmp_path: Path, memory: SensorMemory) -> Iterator[Evening]:
    all_parts: list[StageParts] = []

    def begun(hands: list[dict[str, object]] | None = None) -> Stage:
        """The box is switched on; what it remembers of before stays."""
        show = load_show(write_show(tmp_path / f"show{len(all_parts)}", hands or [HAND]))
        all_parts.append(
            assemble(show, BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[])))
        )
        return Stage(all_parts[-1], memory)

    yield begun
    for parts in all_parts:
        parts.close()
