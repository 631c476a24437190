"""Dances a run of a journal again: its slots, readings and orders through the same tick."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from appliance.box.clock import Slot
from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.box.orders import Order
from appliance.box.snapshot import restore
from appliance.dancer.puppet import PuppetNetwork
from appliance.recorder.journal_error import JournalError
from appliance.recorder.reading import Run
from appliance.recorder.record import DAMAGED, ORDER, hands_of, puppets_of
from appliance.sensor.link import SensorLink, SensorReading, SensorState
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import Show
from appliance.stage.carry_out import carry_out
from appliance.stage.comparison import Comparison
from appliance.stage.made_again import maker_of
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import assemble
from appliance.stage.tick import Tick

_NO_PORTS = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]), control=None)


class Replay:
    """A run and the tick of its show; nothing is heard but what was recorded, and nothing is sent.

    skipped: ticks that could not be run: before the first keyframe, or around a gap. forced: ticks whose
    network failed then and not here; the failure was taken from the journal.
    Raises JournalError where the show is not the recorded one, StageError, ConfigError.
    """

    def __init__(self, run: Run, show: Show) -> None:
        self.skipped = 0
        self._run = run
        parts = assemble(show, _NO_PORTS, network_of=_RecordedNetwork)
        hands = [[hand["puppet"], hand["joint"]] for hand in run.header["hands"]]
        held = [[number, hand.joint] for number, hand in hands_of(show)]
        if parts.skeleton.names != run.skeleton.names or hands != held or run.puppets != puppets_of(show):
            raise JournalError(
                f"{show.directory}: this show has other figures or other hands than the recorded one "
                f"('{run.header['show']}'). Name its bundle: --show DIR."
            )
        parts.link = self._link = _RecordedLink(run)
        assert isinstance(parts.network, _RecordedNetwork)
        self._network = parts.network
        parts.live_inbox = self._live = _RecordedLive(run)
        parts.make_by(maker_of(show, parts.led.motion))
        self._wearing = SensorFit(parts, SensorMemory(None, _nobody), _nobody)
        self.tick = Tick(parts, self._wearing, 0.0)

    @property
    def forced(self) -> int:
        """Ticks whose network failed then and not here."""
        return self._network.forced

    def dance(self, comparison: Comparison, from_s: float = 0.0) -> Iterator[int]:
        """Run what was recorded, from the last keyframe before a second of the run on; tells `comparison` of
        each tick, and gives how many have been run.
        """
        run, keyframes, rows = self._run, dict(self._run.keyframes), self._rows()
        events, danced, before = dict(run.events), 0, -1
        first = self._first(from_s)
        for number in sorted({*rows, *events, *run.pieces}):
            if number <= first:
                continue
            if number != before + 1:
                if number - 1 not in keyframes:
                    self.skipped += number in rows
                    continue
                self._restore(keyframes[number - 1])
            before = number
            if number in rows:
                self._dance_row(rows[number], comparison)
                danced += 1
                yield danced
            elif number in events and events[number]["kind"] == ORDER:
                self._obey(events[number], comparison)

    def _restore(self, keyframe: bytes) -> None:
        with _refused("A keyframe"):
            restore(self.tick, keyframe)

    def _rows(self) -> dict[int, int]:
        return {int(number): row for row, number in enumerate(self._run.tick_numbers)}

    def _first(self, from_s: float) -> int:
        """Number of log entries before the keyframe to start from."""
        run = self._run
        begun = run.ticks["frame_time"][0] + from_s
        positions = [position for position, _ in run.keyframes]
        if not positions:
            raise JournalError("No keyframe of this run was kept: it can be drawn, but not danced again.")
        rows = np.searchsorted(run.tick_numbers, positions, side="right")
        times = [run.ticks["frame_time"][row] if row < len(run.ticks) else np.inf for row in rows]
        early = [position for position, time in zip(positions, times, strict=True) if time <= begun]
        return early[-1] if from_s > 0.0 and early else 0

    def _dance_row(self, row: int, comparison: Comparison) -> None:
        recorded = self._run.ticks[row]
        self._link.row = self._live.row = row
        self._network.fails = recorded["failed"].tolist()
        slot = Slot(
            int(recorded["tick"]),
            float(recorded["frame_time"]),
            float(recorded["started"]),
            int(recorded["skipped"]),
        )
        with _refused(f"Tick {slot.tick}, or the keyframe before it,"):
            self.tick.run(slot)
            self.tick.after(slot)
            comparison.look(recorded, self.tick)

    def _obey(self, event: dict[str, Any], comparison: Comparison) -> None:
        with _refused("An order, or the keyframe before it,"):
            asked, now, done_then = event["order"], float(event["now"]), bool(event["done"])
            order = Order(asked["name"], tuple(map(float, asked["values"])), asked["text"])
            self._link.answers(order.text, done_then)
            done, _ = carry_out(order, self.tick.parts, self._wearing, now)
            comparison.note_order(order.name, done_then, done)


@contextmanager
def _refused(what: str) -> Iterator[None]:
    """A journal holds whatever somebody wrote into it: what cannot be danced is refused in words."""
    try:
        yield
    except DAMAGED as error:
        raise JournalError(
            f"{what} is of another release, or damaged ({type(error).__name__}: {error}). The run can be "
            "drawn; to dance it again, take the release that recorded it."
        ) from error


class _RecordedNetwork(PuppetNetwork):
    """The show's network; where it failed then, it fails here too.

    fails: for each puppet, whether it failed then; forced: how often it did, and does not here.
    """

    fails: Sequence[int] = ()
    forced = 0

    def dance(self) -> None:
        super().dance()
        for puppet, fails in zip(self.puppets, self.fails, strict=True):
            if fails and not puppet.is_broken:
                self.forced += 1
                puppet.is_broken = True


class _RecordedLive(LivePoseReader):
    """Gives the live pose of the row that is at hand."""

    def __init__(self, run: Run) -> None:
        self._ticks, self.row = run.ticks, 0

    def read(self) -> LivePose | None:
        recorded = self._ticks[self.row]
        arrival = recorded["live_arrival"]
        if not arrival.size or math.isnan(arrival[0]):
            return None
        x, y, z = recorded["live_root"][0].tolist()
        return LivePose(float(arrival[0]), (x, y, z), recorded["live_pose"].tobytes())

    def close(self) -> None:
        pass


class _RecordedLink(SensorLink):
    """Gives the readings of the row that is at hand."""

    def __init__(self, run: Run) -> None:
        super().__init__({}, ())
        self.row = 0
        self._ticks, self._sensors = run.ticks, run.header["sensors"]
        self._asked: tuple[set[str], bool] = set(), False

    def answers(self, sensor: str | int, done: bool) -> None:
        """Whether the sensors were there when a person asked for something."""
        self._asked = {*self._sensors, str(sensor)} - {""}, done

    def drain(self, now: float) -> Sequence[SensorReading]:
        here = self._ticks["reading_here"][self.row]
        return [self._reading(place, name) for place, name in enumerate(self._sensors) if here[place]]

    def states(self, now: float) -> list[SensorState]:
        names, are_here = self._asked
        state = "linked" if are_here else "absent"
        return [
            SensorState(name, 0, state, "", 0.0, 0.0, None, None, 255, 0, "", "", 0, 0, "")
            for name in sorted(names)
        ]

    def _reading(self, place: int, name: str) -> SensorReading:
        w, x, y, z = self._ticks["reading_orientation"][self.row, place].tolist()
        measured_at, arrival, trip_s = self._ticks["reading_times"][self.row, place].tolist()
        numbers = self._ticks["reading_numbers"][self.row, place].tolist()
        sequence, time_us, battery, calibration, boot_nonce, taps, recoveries, flags, wearable = numbers
        return SensorReading(
            *(name, (w, x, y, z), sequence, time_us, measured_at, arrival, battery, calibration),
            *(boot_nonce, taps, recoveries, flags, None if trip_s != trip_s else trip_s, wearable),
        )


def _nobody(words: str) -> None:
    """A replay takes the messages of that night from the events."""
