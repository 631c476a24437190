"""The keeper's fallbacks, as it tells them: what cannot be kept on the disk, while the dance goes on."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from appliance.box.checkpoint_file import CheckpointCarrier
from appliance.box.fallback import Fallback, Fallbacks
from appliance.box.process_health import ProcessHealthWriter
from appliance.keeper.journal_carrier import JournalCarrier
from appliance.keeper.sensor_memory_carrier import MemoryCarrier

JOURNAL_STOPPED = Fallback(
    JournalCarrier.fallback,
    "The journal does not grow: the disk is full, read-only or gone. The audience sees nothing of it; the "
    "newest minute stays in memory, and it is tried again each 10 s. Free some room, or look at the disk.",
)
PLACE_NOT_KEPT = Fallback(
    CheckpointCarrier.fallback,
    "The place of the dance is not kept on the disk. The audience sees nothing of it, but after a power cut "
    "the dance begins where it was kept last. Free some room, or look at the disk.",
)
SENSORS_NOT_KEPT = Fallback(
    MemoryCarrier.fallback,
    "Neutral poses and calibrations are not kept on the disk. The audience sees nothing of it, but after a "
    "power cut sensors need a moment of stillness. Free some room, or look at the disk.",
)
CHOICE_NOT_KEPT = Fallback(
    "choice-not-kept",
    "That a show has danced, or has not, cannot be kept. The audience sees nothing of it; after the next "
    "power-on it is tried anew. Free some room, or look at the disk.",
)
OF_THE_KEEPER = (JOURNAL_STOPPED, PLACE_NOT_KEPT, SENSORS_NOT_KEPT, CHOICE_NOT_KEPT)


class Complaining(Protocol):
    """What is told of: a carrier, or its process."""

    @property
    def complaint(self) -> str: ...

    @property
    def fallback(self) -> str: ...


class KeeperHealth:
    """What the keeper tells the box's other processes."""

    def __init__(self, runtime: Path) -> None:
        self._fallbacks = Fallbacks(OF_THE_KEEPER)
        self._block = ProcessHealthWriter(runtime, "keeper", self._fallbacks)

    def tell(self, kept: Iterable[Complaining], now: float) -> None:
        """Call it often; monotonic seconds."""
        for one in kept:
            self._fallbacks.set(one.fallback, bool(one.complaint), one.complaint)
        self._block.tell(now)

    def end(self, now: float) -> None:
        """The keeper ends as it should."""
        self._block.end(now)
        self._block.close()
