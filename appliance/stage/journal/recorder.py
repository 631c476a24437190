"""The recorder: the stage's end of the journal, in memory that the keeper reads; it never waits or raises."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from appliance.stage.clock import Slot

if TYPE_CHECKING:
    from appliance.stage.tick import Tick

FILE, KIND, FORMAT = "journal", "journal", 1  # in the runtime folder


class Recorder:
    """Notes each tick, each event and now and then the whole state of the dance.

    Raises OSError where the runtime folder takes no file of its size. lost: events that could not be noted.
    """

    def __init__(self, folder: Path, facts: dict[str, Any]) -> None:
        self.lost = 0

    def note_tick(self, slot: Slot, tick: Tick, flags: int) -> None:
        """The frame of this slot has left."""

    def event(self, kind: str, now: float, **facts: Any) -> None:
        """Something happened between two ticks: `facts` as JSON, 1 KiB at most (long strings lose their end).

        `now`: seconds on the monotonic clock.
        """

    def keyframe(self, state: dict[str, Any]) -> None:
        """The whole state of the dance, from which a replay may start: plain values and arrays."""

    def close(self) -> None:
        """Let go of the file; it stays for the keeper."""
