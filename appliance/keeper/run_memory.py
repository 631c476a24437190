"""The keeper's end of the journal's memory: what a stage has noted since the last look."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from appliance.box.ring_file import RingFileReader
from appliance.pose.foreign_file import plain_json
from appliance.recorder.journal_error import JournalError
from appliance.recorder.log import POSITION, Entry
from appliance.recorder.record import DAMAGED, TICK, layout_of, require_sound
from appliance.stage.recorder import (
    ENTRY,
    FACTS,
    FORMAT,
    KEYFRAME_SLOTS,
    KEYFRAMES,
    KIND,
    LOG,
    LOG_SLOTS,
    RINGS,
)


@dataclass(frozen=True)
class Keyframe:
    """The state of the dance after this many entries of the log, packed."""

    position: int
    data: bytes


@dataclass(frozen=True)
class Piece:
    """Entries written to disk together: a keyframe, if there is one, and the entries after it."""

    keyframe: Keyframe | None
    entries: list[Entry]

    @property
    def ticks(self) -> int:
        """How many of the entries are ticks."""
        return sum(one.kind == TICK for one in self.entries)


class RunMemory:
    """One stage's memory. It can be read while the stage dances, and after it has died.

    entries, keyframe: number of the last entry and position of the last keyframe on the disk.
    """

    def __init__(self, reader: RingFileReader, facts: dict[str, Any], identity: tuple[int, int]) -> None:
        self.facts = facts
        self.entries, self.keyframe = 0, -1
        self._reader, self._identity = reader, identity
        self._tick_bytes = layout_of(facts).itemsize

    @classmethod
    def at(cls, path: Path) -> RunMemory | None:
        """The memory of the stage that has this file, None where there is none.

        Raises JournalError for one that cannot be read, or was noted by another release.
        """
        try:
            found = path.stat()
        except OSError:
            return None
        reader = RingFileReader(path, KIND, FORMAT, "the stage (bunraku play)")
        reader.look()
        with contextlib.ExitStack() as leaving:
            leaving.callback(reader.close)
            said = reader.rings[FACTS].newest() if reader.rings else None
            if said is None and not reader.complaint:
                return None
            if said is None or len(reader.rings) != RINGS:
                raise JournalError(reader.complaint or _foreign(path, "other rings"))
            try:
                facts = plain_json(said[1])
                require_sound(
                    facts | {"show_files": dict.fromkeys(facts["show_files"], ""), "written_at": 0.0}
                )
            except DAMAGED as error:
                raise JournalError(_foreign(path, str(error))) from error
            leaving.pop_all()
        return cls(reader, facts, (found.st_dev, found.st_ino))

    def is_at(self, path: Path) -> bool:
        """Whether this path still leads to it; if not, another stage has taken its place."""
        try:
            found = path.stat()
        except OSError:
            return True
        return (found.st_dev, found.st_ino) == self._identity

    def news(self) -> Iterator[Piece]:
        """Entries recorded since the last kept piece; `keep` each before the next is taken."""
        newest = self._reader.rings[LOG].newest_sequence()
        frames = [frame for frame in self._keyframes() if self.keyframe < frame.position <= newest]
        ends = [*(frame.position for frame in frames), newest]
        for frame, end in zip([None, *frames], ends, strict=True):
            if frame is not None or end > self.entries:
                yield Piece(frame, list(self._taken(end)))

    def keep(self, piece: Piece) -> None:
        """It is on the disk."""
        if piece.keyframe is not None:
            self.keyframe = piece.keyframe.position
            self.entries = max(self.entries, piece.keyframe.position)
        if piece.entries:
            self.entries = piece.entries[-1].number

    def close(self) -> None:
        self._reader.close()

    def _keyframes(self) -> Iterator[Keyframe]:
        ring = self._reader.rings[KEYFRAMES]
        newest = ring.newest_sequence()
        for sequence in range(max(1, newest - KEYFRAME_SLOTS + 1), newest + 1):
            found = ring.payload(sequence)
            if found is not None:
                yield Keyframe(POSITION.unpack_from(found)[0], found[POSITION.size :])

    def _taken(self, end: int) -> Iterator[Entry]:
        """Entries up to this one; the oldest of many may be overwritten meanwhile."""
        ring = self._reader.rings[LOG]
        for number in range(max(self.entries + 1, end - LOG_SLOTS + 1), end + 1):
            found = ring.payload(number)
            if found is not None:
                (kind,) = ENTRY.unpack_from(found)
                body = found[ENTRY.size :]
                yield Entry(number, kind, body[: self._tick_bytes] if kind == TICK else body)


def _foreign(path: Path, why: str) -> str:
    return (
        f"{path}: the journal stops growing: what the stage has noted is not of this release ({why}). "
        "The dance goes on. Start a stage and a keeper of one release."
    )
