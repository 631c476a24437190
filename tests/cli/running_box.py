"""What `bunraku sensors` sees and asks: show control at a real control port, and a stage double behind it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import yaml

from appliance.box.orders import Order
from appliance.cli.doctor.host_view import running_stage
from appliance.sensor.link import SensorState
from appliance.sensor.wire import HAS_PROFILE
from appliance.show.box import load_box
from appliance.stage.sensor_lines import roster_lines
from tests.show_control.doubles import ControlInThread, StageDouble, until

LEFT = SensorState(
    *("left-wrist", 0x1A2B3C4D, "linked", "192.168.4.7:2390", 49.96, 0.0123, 0.0042, 0.013),
    *(12, 0b00111011, "1.0.0", "00112233445566778899aabbccddeeff", HAS_PROFILE, 77, ""),
)

LOST = LEFT._replace(name="head", state="lost", rate_hz=0.0, round_trip_s=None, age_s=192.0, battery=255)

SPARE = SensorState(
    *("spare-1", 5, "absent", "", 0.0, 0.0, None, None, 255, 0, "", "", 0, 0, "Its firmware is older.")
)


class RunningBox:
    """Show control, and a stage double that answers."""

    def __init__(self, folder: Path, key_file: Path | None = None) -> None:
        runtime = folder / "runtime"
        runtime.mkdir(mode=0o700)
        self.stage = StageDouble(runtime)
        self.stage.answer = lambda order: (self.done, f"{order.name} it is.")
        self.done = True
        self.control = ControlInThread(runtime, key_file or folder / "sensors.keys")
        self.box_file = folder / "box.yaml"
        settings = {
            "runtime": str(runtime),
            "sensors": {"keys": "sensors.keys"},
            "control": {"host": "0.0.0.0", "port": self.control.port, "senders": ["10.0.0.1"]},
        }
        self.box_file.write_text(yaml.safe_dump(settings))
        self.stage.__enter__()
        until(lambda: self.control.process.handler.status(0, time.monotonic()).state == "dancing")
        until(self._told_its_key_file)

    def _told_its_key_file(self) -> bool:
        stage = running_stage(load_box(self.box_file))
        return stage is not None and stage.key_file is not None

    @property
    def orders(self) -> list[Order]:
        return self.stage.orders

    def report_sensors(self, states: list[SensorState], neutral_of: Callable[[str], str], now: float) -> None:
        """The stage reports its sensors."""
        self.stage.tell(sensors=roster_lines(states, neutral_of), looked_at=now)

    def close(self) -> None:
        self.control.close()
        self.stage.__exit__(None, None, None)
