"""Dances a run of a journal again: its slots, readings and orders through the same tick."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from appliance.box.snapshot import restore
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import Run
from appliance.recorder.record import DAMAGED, ORDER, hands_of, puppets_of
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import Show
from appliance.stage.comparison import Comparison
from appliance.stage.made_again import maker_of
from appliance.stage.rerun import RecordedNetwork, Rerun
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
        parts = assemble(show, _NO_PORTS, network_of=RecordedNetwork)
        hands = [[hand["puppet"], hand["joint"]] for hand in run.header["hands"]]
        held = [[number, hand.joint] for number, hand in hands_of(show)]
        if parts.skeleton.names != run.skeleton.names or hands != held or run.puppets != puppets_of(show):
            raise JournalError(
                f"{show.directory}: this show has other figures or other hands than the recorded one "
                f"('{run.header['show']}'). Name its bundle: --show DIR."
            )
        assert isinstance(parts.network, RecordedNetwork)
        self._network = parts.network
        parts.make_by(maker_of(show, parts.led.motion))
        wearing = SensorFit(parts, SensorMemory(None))
        self.tick = Tick(parts, wearing, 0.0)
        self._rerun = Rerun(self.tick, wearing, run.header["sensors"])
        parts.link, parts.live_inbox = self._rerun.heard, self._rerun.live

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
        with _refused(f"Tick {int(recorded['tick'])}, or the keyframe before it,"):
            self._rerun.dance(recorded)
            comparison.look(recorded, self.tick)

    def _obey(self, event: dict[str, Any], comparison: Comparison) -> None:
        with _refused("An order, or the keyframe before it,"):
            order, done_then, done = self._rerun.obey(event)
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
