"""A night of dancing under the test's clock: a real tick, a real recorder, a real carrier."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from appliance.box.clock import TICK_S, Slot
from appliance.box.orders import Order
from appliance.box.snapshot import packed
from appliance.keeper.journal import MirroredJournal
from appliance.keeper.mirror import Mirror
from appliance.levers.show_state import ShowState
from appliance.recorder.record import ORDER, facts_of_run
from appliance.sensor.link import SensorLink, SensorReading, SensorState
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.show_control.command import Command
from appliance.show_control.show_state_commands import declare
from appliance.stage.carry_out import carry_out
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.recorder import Recorder
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import assemble
from appliance.stage.tick import Tick
from tests.logged import said

BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
LATEST_START_S = 0.005


class Night:
    """One start of the stage. said: what the keeper and the recorder logged."""

    def __init__(self, show: Path, runtime: Path, begins_at: float = 1000.0) -> None:
        runtime.mkdir(mode=0o700, exist_ok=True, parents=True)
        self.runtime, self.show, self.said = runtime, load_show(show), said
        self.parts = assemble(self.show, BOX)
        self.heard = self.parts.link = _Heard()
        self.wearing = SensorFit(self.parts, SensorMemory(None))
        self.parts.led.iterations = Iterations(3, 2, 10)
        self.tick = Tick(self.parts, self.wearing, LATEST_START_S)
        self._declared = _Declared(self.show.config.name)
        self.reconciler = Reconciler(self.show.config.name, self.parts, self._declared)
        facts = facts_of_run(self.show, list(self.parts.worn))
        self.recorder = Recorder(runtime, facts, len(packed(self.parts)))
        self.slot = Slot(-1, begins_at, begins_at)
        self.recorder.keyframe(self.tick)

    def dance(self, ticks: int, reading: SensorReading | None = None, late_s: float = 0.0) -> None:
        """So many ticks, each with this reading, anew."""
        for _ in range(ticks):
            self.slot.tick += 1
            self.slot.deadline += TICK_S
            self.slot.started = self.slot.deadline + late_s
            sequence = self.slot.tick
            arrival = self.slot.started - 0.001
            came = None if reading is None else reading._replace(sequence=sequence, arrival=arrival)
            self.heard.coming = [] if came is None else [came]
            self.tick.run(self.slot)
            self.tick.after(self.slot)
            self.recorder.note_tick(self.slot, self.tick, self.tick.late)
            if self.recorder.wants_keyframe:
                self.recorder.keyframe(self.tick)

    def order(self, name: str, *values: float, text: str = "") -> tuple[bool, str]:
        """What show control asks for, after the last tick."""
        return self._carry_out(Order(name, tuple(values), text), self.slot.started)

    def command(self, address: str, *values: float, text: str = "") -> None:
        """What show control declares at a command; the dance follows after the last tick."""
        now, facts = self.slot.started, facts_of(self.show, None, self.parts.led.iterations, 0.0)
        command = Command(address, values, text)
        self._declared.now, _ = declare(self._declared.now, command, facts, now)
        for order in self.reconciler.pending(now):
            self._carry_out(order, now)

    def _carry_out(self, order: Order, now: float) -> tuple[bool, str]:
        done, message = carry_out(order, self.parts, self.wearing, now)
        asked = {"name": order.name, "values": order.values, "text": order.text}
        self.recorder.event(ORDER, now, order=asked, done=done, message=message)
        return done, message

    def mirror(self, folder: Path, minutes: float = 30.0) -> Mirror:
        """Keeps this night in a folder."""
        return Mirror(MirroredJournal(self.runtime, folder, minutes, lambda: 1.8e9))

    def saved(self, folder: Path) -> Path:
        """The folder, once all that was noted is in it."""
        self.mirror(folder).last_turn(0.0)
        return folder


def reading(
    orientation: Sequence[float], boot_nonce: int = 1, taps: int = 0, wearable: int = 1
) -> SensorReading:
    """Of the left wrist."""
    w, x, y, z = orientation
    return SensorReading(
        *("left-wrist", (w, x, y, z), 0, 0, 0.0, 0.0, 90, 255),
        *(boot_nonce, taps),
        wearable=wearable,
    )


class _Declared:
    """The show state as the test declares it."""

    def __init__(self, show: str) -> None:
        self.now = ShowState(show=show)

    def read(self) -> ShowState:
        return self.now


class _Heard(SensorLink):
    """A link that gives what the test lets come; the sensor is there whenever somebody asks."""

    def __init__(self) -> None:
        super().__init__({}, ())
        self.coming: list[SensorReading] = []

    def drain(self, now: float) -> Sequence[SensorReading]:
        return self.coming

    def states(self, now: float) -> list[SensorState]:
        return [SensorState("left-wrist", 0, "linked", "", 50.0, 0, None, 0.0, 90, 255, "", "", 0, 1, "")]
