"""Mirrors the journal: from the stage's memory into segments on the disk, as far as the disk takes it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path

from appliance.box.clock import TICK_S
from appliance.keeper.fallback import JOURNAL_STOPPED
from appliance.keeper.mirror import RETRY_S
from appliance.keeper.run_memory import Piece, RunMemory
from appliance.recorder import chunks, log
from appliance.recorder.environment import environment, fingerprints
from appliance.recorder.journal_reader import last_saved
from appliance.recorder.segments import Segments
from appliance.show.bundle import default_show_path
from appliance.stage.recorder import FILE


class MirroredJournal:
    """The entries that the stage has recorded since the last turn.

    While the disk takes nothing, the stage's memory holds the last 80 s; they follow when it recovers.
    """

    name, fallback = "The journal", JOURNAL_STOPPED

    def __init__(
        self, runtime: Path, folder: Path, minutes: float, wall_clock: Callable[[], float] = time.time
    ) -> None:
        """runtime: the folder where the box's processes meet; folder: where on the disk the segments go."""
        self.recovered = f"{folder}: the journal grows again."
        self._memory_file, self.folder, self._wall_clock = runtime / FILE, folder, wall_clock
        self._segments = Segments(folder, round(minutes * 60.0 / TICK_S))
        self._memory: RunMemory | None = None
        self._environment = environment()

    def copy(self, now: float) -> None:
        """Append what the stage has noted; where another stage began, first the rest of the old one."""
        try:
            if self._memory is not None:
                is_over = not self._memory.is_at(self._memory_file)
                self._append_pieces(self._memory)
                if not is_over:
                    return
                self._memory.close()
                self._memory = None
                self._segments.finish()
            self._memory = RunMemory.at(self._memory_file)
            if self._memory is not None:
                self._memory.entries, self._memory.keyframe = last_saved(
                    self.folder, self._memory.facts["run"]
                )
                self._append_pieces(self._memory)
        except OSError:
            self._segments.forget()
            raise

    def explain(self, error: Exception) -> str:
        if not isinstance(error, OSError):
            return str(error)
        return (
            f"{self.folder}: the journal stops growing ({error.strerror}). The dance goes on, and what was "
            f"recorded before stays. The disk is tried again each {RETRY_S:g} s. Free the disk, or check "
            "that it is there and can be written to."
        )

    def close(self) -> None:
        """Complete the segment, and release the stage's memory."""
        self._segments.finish()
        if self._memory is not None:
            self._memory.close()

    def _append_pieces(self, memory: RunMemory) -> None:
        for piece in memory.news():
            self._append(memory, piece)
            memory.keep(piece)

    def _append(self, memory: RunMemory, piece: Piece) -> None:
        data = []
        if not self._segments.is_open or (piece.keyframe is not None and self._segments.is_complete):
            self._segments.begin()
            data.append(chunks.chunk(chunks.HEADER, self._header(memory)))
        if piece.keyframe is not None:
            frame = log.POSITION.pack(piece.keyframe.position) + piece.keyframe.data
            data.append(chunks.chunk(chunks.KEYFRAME, frame))
        if piece.entries:
            data.append(chunks.chunk(chunks.LOG, log.packed(piece.entries), piece.ticks))
        self._segments.append(b"".join(data), piece.ticks)

    def _header(self, memory: RunMemory) -> bytes:
        """The run's facts, and those that are too slow to collect in the stage."""
        facts = memory.facts
        directory = facts["show_directory"]
        files = fingerprints(
            default_show_path() if directory is None else Path(directory), facts["show_files"]
        )
        reported = self._environment | facts | {"show_files": files, "written_at": self._wall_clock()}
        return json.dumps(reported).encode()
