"""Carries the journal from the stage's memory into segments on the disk, as far as the disk takes it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path

from appliance.box.clock import TICK_S
from appliance.keeper.run_memory import Piece, RunMemory
from appliance.recorder import chunks, log
from appliance.recorder.environment import environment, fingerprints
from appliance.recorder.journal_error import JournalError
from appliance.recorder.keyframe import POSITION
from appliance.recorder.reading import last_kept
from appliance.recorder.segments import Segments
from appliance.show.bundle import default_show_path
from appliance.stage.recorder import FILE

RETRY_S = 10.0


class JournalCarrier:
    """Brings to the disk what the stage has noted since the last turn.

    While the disk takes nothing, the stage's memory holds the last 80 s; they follow when it takes something
    again. complaint: why nothing is kept, or "". errors: how often the disk refused.
    """

    fallback = "journal-stopped"

    def __init__(
        self,
        runtime: Path,
        folder: Path,
        minutes: float,
        say: Callable[[str], None],
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        """runtime: the folder where the box's processes meet; folder: where on the disk the segments go."""
        self.complaint = ""
        self.errors = 0
        self._memory_file, self._folder, self._wall_clock = runtime / FILE, folder, wall_clock
        self._say = say
        self._segments = Segments(folder, round(minutes * 60.0 / TICK_S))
        self._memory: RunMemory | None = None
        self._environment = environment()
        self._again_at = 0.0

    def turn(self, now: float) -> None:
        """Bring the disk up to date; monotonic seconds. Waits as long as the disk does. Never raises."""
        if now >= self._again_at:
            self._again_at = now + self._carry()

    def last_turn(self) -> None:
        """Before the process ends: the rest."""
        self._carry()
        self._segments.finish()
        if self._memory is not None:
            self._memory.close()

    def _carry(self) -> float:
        """Keep what is new; seconds to wait until the next time."""
        try:
            self._follow()
        except OSError as error:
            self.errors += 1
            self._segments.forget()
            self._complain(
                f"{self._folder}: the journal stops growing ({error.strerror}). The dance goes on, and what "
                f"was recorded before stays. It is tried again each {RETRY_S:g} s. Free the disk, or look "
                "whether it is there and can be written to."
            )
            return RETRY_S
        except JournalError as error:
            self._complain(str(error))
            return RETRY_S
        if self.complaint:
            self.complaint = ""
            self._say(f"{self._folder}: the journal grows again.")
        return 0.0

    def _complain(self, complaint: str) -> None:
        if complaint != self.complaint:
            self._say(complaint)
        self.complaint = complaint

    def _follow(self) -> None:
        """Keep what this stage has noted; once another has its place, first the rest, then the other's."""
        if self._memory is not None:
            is_over = not self._memory.is_at(self._memory_file)
            self._keep(self._memory)
            if not is_over:
                return
            self._memory.close()
            self._segments.finish()
        self._memory = RunMemory.at(self._memory_file)
        if self._memory is not None:
            self._memory.entries, self._memory.keyframe = last_kept(self._folder, self._memory.facts["run"])
            self._keep(self._memory)

    def _keep(self, memory: RunMemory) -> None:
        for piece in memory.news():
            self._append(memory, piece)
            memory.keep(piece)

    def _append(self, memory: RunMemory, piece: Piece) -> None:
        data = []
        if not self._segments.is_open or (piece.keyframe is not None and self._segments.is_complete):
            self._segments.begin()
            data.append(chunks.chunk(chunks.HEADER, self._header(memory)))
        if piece.keyframe is not None:
            frame = POSITION.pack(piece.keyframe.position) + piece.keyframe.data
            data.append(chunks.chunk(chunks.KEYFRAME, frame))
        if piece.entries:
            data.append(chunks.chunk(chunks.LOG, log.packed(piece.entries), piece.ticks))
        self._segments.append(b"".join(data), piece.ticks)

    def _header(self, memory: RunMemory) -> bytes:
        """The run's facts, and what only this process may take its time for."""
        facts = memory.facts
        directory = facts["show_directory"]
        files = fingerprints(
            default_show_path() if directory is None else Path(directory), facts["show_files"]
        )
        told = self._environment | facts | {"show_files": files, "written_at": self._wall_clock()}
        return json.dumps(told).encode()
