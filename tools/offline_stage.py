"""A stage without ports and as fast as the machine allows, for measurements of what it dances."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from appliance.box.clock import TICK_S, Slot
from appliance.box.orders import Order
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.stage.carry_out import carry_out
from appliance.stage.iterations import Iterations
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import assemble
from appliance.stage.tick import Tick

_NO_PORTS = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]), control=None)


class OfflineStage:
    """A stage of a show's bundle; `dance` runs a tick, `order` comes between two of them."""

    def __init__(self, bundle: Path, iterations: tuple[int, int] = (3, 2)) -> None:
        """iterations: of each puppet, fewer than on stage where only ways are measured."""
        self.parts = assemble(load_show(bundle), _NO_PORTS)
        for one in self.parts.puppets:
            one.iterations = Iterations(*iterations, 10)
        self._wearing = SensorFit(self.parts, SensorMemory(None))
        self._tick, self._slot = Tick(self.parts, self._wearing, 1.0), Slot(-1, 0.0, 0.0)

    def dance(self) -> None:
        """One tick."""
        slot = self._slot
        slot.tick, slot.deadline = slot.tick + 1, slot.deadline + TICK_S
        slot.started = slot.deadline
        self._tick.run(slot)
        self._tick.after(slot)

    def order(self, name: str, *values: float, text: str = "") -> None:
        """Raises ValueError where the stage does not carry it out."""
        done, message = carry_out(Order(name, values, text), self.parts, self._wearing, self._slot.started)
        if not done:
            raise ValueError(message)


def changed_show(folder: Path, changes: Mapping[str, Any]) -> Path:
    """A copy of the default show in a folder, with other keys in its show.yaml; motion's are added."""
    shutil.copytree(default_show_path(), folder)
    config = yaml.safe_load((folder / "show.yaml").read_text())
    config["motion"] |= changes.get("motion", {})
    config |= {name: value for name, value in changes.items() if name != "motion"}
    (folder / "show.yaml").write_text(yaml.safe_dump(config))
    return folder
