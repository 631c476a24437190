"""The recorder: the stage's end of the journal, in memory that the keeper reads; it never waits or raises."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from appliance.box.live_pose import LivePose
from appliance.box.ring_file import RingFileWriter
from appliance.box.snapshot import packed
from appliance.recorder.log import POSITION, pieces_of
from appliance.recorder.record import EVENT, JUMPED, LATE, NOT_FINITE, PIECE, RESENT, TICK, layout_of

if TYPE_CHECKING:
    from appliance.box.clock import Slot
    from appliance.stage.tick import Tick

FILE, KIND, FORMAT = "journal", "journal", 1  # in the runtime folder
RINGS = 3
FACTS, LOG, KEYFRAMES = range(RINGS)  # the rings in the file
LOG_SLOTS = 4096  # 80 s: how long the disk may hang before the journal loses a tick
KEYFRAME_TICKS = 500  # from one keyframe to the next
KEYFRAME_SLOTS = 1 + LOG_SLOTS // KEYFRAME_TICKS
KEYFRAME_BYTES, KEYFRAME_JOINT_BYTES = 1 << 16, 1 << 9  # a puppet's, and for each joint
EVENT_BYTES = 1024  # in one entry
LONGEST_EVENT = 8 * EVENT_BYTES  # the recipe of an improvisation with its prompt has half of that
ENTRY = struct.Struct("<Q")  # kind of an entry of the log; then the tick's record, or the event as JSON

_NO_ROUND_TRIP = _NOT_HEARD = float("nan")


class Recorder:
    """Notes each tick, each event and now and then the whole state of the dance.

    Raises OSError where the runtime folder takes no file of its size. lost: what could not be noted.
    """

    def __init__(self, folder: Path, facts: dict[str, Any], state_bytes: int = 0) -> None:
        """facts: of this run, as record.facts_of_run gives them. state_bytes: size of the parts in a
        keyframe; a puppet that goes on by itself has 1.4 KB for each joint.
        """
        said, layout = json.dumps(facts).encode(), layout_of(facts)
        entry_bytes = ENTRY.size + max(layout.itemsize, EVENT_BYTES)
        of_joints = KEYFRAME_JOINT_BYTES * len(facts["joints"]) * len(facts["puppets"])
        keyframe_bytes = KEYFRAME_BYTES * len(facts["puppets"]) + max(of_joints, state_bytes)
        shapes = [(1, len(said)), (LOG_SLOTS, entry_bytes), (KEYFRAME_SLOTS, keyframe_bytes)]
        self.lost = 0
        self.tap: Callable[[int, bytes], None] | None = None  # gets what is noted: kind, and record or JSON
        self._file = RingFileWriter.new(folder / FILE, KIND, FORMAT, shapes)
        self._file.rings[FACTS].write(said)
        self._log = self._file.rings[LOG]
        row = np.frombuffer(self._log.payload, layout, 1, ENTRY.size)
        self._field: dict[str, np.ndarray[Any, Any]] = {name: row[name] for name in layout.names or ()}
        self._sensors = {name: place for place, name in enumerate(facts["sensors"])}
        self._entries, self._ends = 0, ENTRY.size + layout.itemsize
        self._ticks = 0
        self._file.publish()

    @property
    def wants_keyframe(self) -> bool:
        """Whether the next keyframe is due."""
        return self._ticks >= KEYFRAME_TICKS

    def note_tick(self, slot: Slot, tick: Tick, late: bool) -> None:
        """The frames of this slot have left: one copy into the memory. late: they left late, or will."""
        field, puppets = self._field, tick.parts.puppets
        ENTRY.pack_into(self._log.payload, 0, TICK)
        field["tick"][0] = slot.tick
        field["frame_time"][0] = slot.deadline
        field["started"][0] = slot.started
        field["skipped"][0] = slot.skipped
        field["sensor_sequence"][0] = tick.frame.sensor_sequence
        field["sensor_arrival"][0] = tick.frame.sensor_arrival
        jumped = any(puppet.motion.jumped for puppet in puppets)
        field["flags"][0] = (
            late * LATE | tick.late * RESENT | tick.network_failed * NOT_FINITE | jumped * JUMPED
        )
        field["sections_ms"][0] = tick.sections_ms
        row = 0
        for number, puppet in enumerate(puppets):
            field["failed"][0, number] = puppet.network_failed
            field["iterations"][0, number] = puppet.iterations.coding, puppet.iterations.interaction
            field["root"][0, number] = puppet.frame.root
            field["pose"][0, number] = puppet.frame.pose
            hands = puppet.hands
            for place, by_place in zip(puppet.hand_places, hands.by_place, strict=True):
                field["targets"][0, row] = hands.targets[0, place]
                if by_place:
                    field["targets"][0, row, 0] = 0.0
                    field["targets"][0, row, 1:] = hands.places[place]
                field["weights"][0, row] = hands.holds[place]
                row += 1
        self._note_readings(tick)
        self._note_live(tick.live_heard)
        if self.tap is not None:
            self.tap(TICK, bytes(self._log.payload[ENTRY.size : self._ends]))
        self._log.publish()
        self._entries += 1
        self._ticks += 1

    def event(self, kind: str, now: float, **facts: Any) -> None:
        """Something happened between two ticks: `facts` as JSON (beyond LONGEST_EVENT texts lose their end).

        `now`: seconds on the monotonic clock.
        """
        try:
            said = _within({"kind": kind, "now": now} | facts)
            if self.tap is not None:
                self.tap(EVENT, said)
            for entry in _entries_of(said):
                self._log.write(entry)
                self._entries += 1
        except (TypeError, ValueError):
            self.lost += 1

    def keyframe(self, tick: Tick) -> None:
        """The whole state of the dance, from which a replay may start."""
        self._ticks = 0
        try:
            self._file.rings[KEYFRAMES].write(POSITION.pack(self._entries) + packed(tick))
        except (TypeError, ValueError):
            self.lost += 1

    def close(self) -> None:
        """Let go of the file; it stays for the keeper, which may not have read all of it yet."""
        self._file.close()

    def _note_live(self, heard: LivePose | None) -> None:
        field = self._field
        if not field["live_arrival"].size:
            return
        field["live_arrival"][0] = _NOT_HEARD if heard is None else heard.arrival
        if heard is not None:
            field["live_root"][0] = heard.root
            field["live_pose"][0] = np.frombuffer(heard.rotations, np.float32).reshape(-1, 4)

    def _note_readings(self, tick: Tick) -> None:
        field = self._field
        for name in ("reading_here", "reading_orientation", "reading_times", "reading_numbers"):
            field[name][0] = 0
        for one in tick.readings:
            place = self._sensors.get(one.sensor)
            if place is None:
                continue
            trip_s = _NO_ROUND_TRIP if one.round_trip_s is None else one.round_trip_s
            field["reading_here"][0, place] = 1
            field["reading_orientation"][0, place] = one.orientation
            field["reading_times"][0, place] = one.measured_at, one.arrival, trip_s
            field["reading_numbers"][0, place] = (
                *(one.sequence, one.sensor_time_us, one.battery, one.calibration),
                *(one.boot_nonce, one.taps, one.recoveries, one.flags, one.wearable),
            )


def _entries_of(said: bytes) -> Iterator[bytes]:
    """An event as one entry of the log, or as pieces in several."""
    if len(said) <= EVENT_BYTES:
        return iter([ENTRY.pack(EVENT) + said])
    return (ENTRY.pack(PIECE) + piece for piece in pieces_of(said, EVENT_BYTES))


def _within(facts: dict[str, Any]) -> bytes:
    """As JSON that fits an event; the longest text loses its end until it does. Raises ValueError."""
    while len(said := json.dumps(facts).encode()) > LONGEST_EVENT:
        texts = [name for name, value in facts.items() if isinstance(value, str) and len(value) > 1]
        if not texts:
            raise ValueError(f"{len(said)} bytes do not fit an event")
        longest = max(texts, key=lambda name: len(facts[name]))
        facts[longest] = facts[longest][: len(facts[longest]) // 2]
    return said
