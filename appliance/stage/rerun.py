"""Runs ticks again that a stage has recorded: their slots, readings and orders through the same tick."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from appliance.box.clock import Slot
from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.box.orders import Order
from appliance.dancer.puppet import PuppetNetwork
from appliance.sensor.link import SensorLink, SensorReading, SensorState
from appliance.stage.carry_out import carry_out
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.tick import Tick

Recorded = np.void  # one tick in the layout of recorder.record


class RecordedNetwork(PuppetNetwork):
    """The show's network; where it failed then, it fails here too.

    fails: for each puppet, whether it failed then; forced: how often it did, and does not here.
    """

    fails: Sequence[int] = ()
    forced = 0

    def dance(self) -> None:
        super().dance()
        for puppet, fails in zip(self.puppets, self.fails, strict=False):
            if fails and not puppet.is_broken:
                self.forced += 1
                puppet.is_broken = True


class Rerun:
    """Puts recorded ticks and orders through a tick, whose parts hear nothing else meanwhile.

    heard: the link that gives the recorded readings.
    """

    def __init__(self, tick: Tick, wearing: SensorFit, sensors: Sequence[str]) -> None:
        """sensors: whose readings were recorded, in this order."""
        self._tick, self._wearing = tick, wearing
        self.heard, self.live = _RecordedLink(sensors, tick.parts.link), _RecordedLive()

    def dance(self, recorded: Recorded) -> Slot:
        """Run one tick, also what can wait until its frame has left. Raises what DAMAGED lists."""
        self.heard.recorded = self.live.recorded = recorded
        network = self._tick.parts.network
        if isinstance(network, RecordedNetwork):
            network.fails = recorded["failed"].tolist()
        slot = Slot(
            int(recorded["tick"]),
            float(recorded["frame_time"]),
            float(recorded["started"]),
            int(recorded["skipped"]),
        )
        self._tick.run(slot)
        self._tick.after(slot)
        return slot

    def obey(self, event: dict[str, Any]) -> tuple[Order, bool, bool]:
        """Carry out the order of an event: that, whether it was done then, and now."""
        asked, now, done_then = event["order"], float(event["now"]), bool(event["done"])
        order = Order(asked["name"], tuple(map(float, asked["values"])), asked["text"])
        self.heard.answers(order.text, done_then)
        return order, done_then, carry_out(order, self._tick.parts, self._wearing, now)[0]


class _RecordedLive(LivePoseReader):
    """Gives the live pose of the tick that is at hand."""

    recorded: Recorded

    def __init__(self) -> None:
        pass

    def read(self) -> LivePose | None:
        arrival = self.recorded["live_arrival"]
        if not arrival.size or math.isnan(arrival[0]):
            return None
        x, y, z = self.recorded["live_root"][0].tolist()
        return LivePose(float(arrival[0]), (x, y, z), self.recorded["live_pose"].tobytes())

    def close(self) -> None:
        pass


class _RecordedLink(SensorLink):
    """Gives the readings of the tick that is at hand."""

    recorded: Recorded

    def __init__(self, sensors: Sequence[str], own: SensorLink) -> None:
        """own: the link of this box, which has its keys."""
        super().__init__({}, ())
        self._sensors, self._own = sensors, own
        self._asked: tuple[set[str], bool] = set(), False

    def lets_in(self, sensor: str) -> bool:
        return self._own.lets_in(sensor)

    def answers(self, sensor: str | int, done: bool) -> None:
        """Whether the sensors were there when a person asked for something."""
        self._asked = {*self._sensors, str(sensor)} - {""}, done

    def drain(self, now: float) -> Sequence[SensorReading]:
        here = self.recorded["reading_here"]
        return [self._reading(place, name) for place, name in enumerate(self._sensors) if here[place]]

    def drain_late(
        self, sensor: str, until: float, monotonic: Callable[[], float]
    ) -> Sequence[SensorReading]:
        """The recorded readings have those that were waited for."""
        return self.drain(until)

    def states(self, now: float) -> list[SensorState]:
        names, are_here = self._asked
        state = "linked" if are_here else "absent"
        return [
            SensorState(name, 0, state, "", 0.0, 0.0, None, None, 255, 0, "", "", 0, 0, "")
            for name in sorted(names)
        ]

    def _reading(self, place: int, name: str) -> SensorReading:
        w, x, y, z = self.recorded["reading_orientation"][place].tolist()
        measured_at, arrival, trip_s = self.recorded["reading_times"][place].tolist()
        numbers = self.recorded["reading_numbers"][place].tolist()
        sequence, time_us, battery, calibration, boot_nonce, taps, recoveries, flags, wearable = numbers
        return SensorReading(
            sensor=name,
            orientation=(w, x, y, z),
            sequence=sequence,
            sensor_time_us=time_us,
            measured_at=measured_at,
            arrival=arrival,
            battery=battery,
            calibration=calibration,
            boot_nonce=boot_nonce,
            taps=taps,
            recoveries=recoveries,
            flags=flags,
            round_trip_s=None if trip_s != trip_s else trip_s,
            wearable=wearable,
        )
