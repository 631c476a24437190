"""Journals read back: a folder of segments, one segment, or an exported file; torn ends are left out."""

from __future__ import annotations

import contextlib
import itertools
import json
import tarfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

import numpy as np

from appliance.box.realtime import uncollected
from appliance.pose.foreign_file import content, opened
from appliance.pose.skeleton import Skeleton
from appliance.recorder import chunks, log
from appliance.recorder.journal_error import JournalError
from appliance.recorder.record import DAMAGED, EVENT, PIECE, TICK, layout_of, require_sound, skeleton_of
from appliance.recorder.segments import SUFFIX, segment_paths

EXPORTED = ".bunraku"
_OLD_MAGIC = b"bunraku journal 1\n", b"bkj1"
_NAME_ONE = "Name the folder of `bunraku play --journal`, a segment in it, or an exported file."
_LARGEST = 1 << 26  # bytes of a segment: a minute of the show that comes with the box has a fiftieth of it
_MOST_SEGMENTS = 20_000  # in an exported file; a day has 1440 where the disk has room
_USTAR = slice(257, 262), b"ustar"  # where an archive says that it is one
# Memory bound: so much, and four times the stored size (a show's ticks unpack to less than three times).
# An entry costs more than its bytes, and values read from JSON much more.
_LEAST_ROOM, _OF_STORED = 512 << 20, 4
_OF_AN_ENTRY, _OF_JSON = 200, 16

Ticks = np.ndarray[Any, np.dtype[np.void]]


@dataclass(frozen=True)
class Run:
    """The record of a stage from its start to its end, as far as it was kept.

    ticks: a structured array in order of time; `tick_numbers` (N,) their numbers in the log, in which events
    have numbers too: between two that follow on each other nothing is missing. keyframes: (entries of the log
    before it, packed state). pieces: numbers that the parts of long events have.
    """

    header: dict[str, Any]
    ticks: Ticks
    tick_numbers: np.ndarray[Any, np.dtype[np.uint64]]
    events: list[tuple[int, dict[str, Any]]]
    keyframes: list[tuple[int, bytes]]
    pieces: tuple[int, ...] = ()

    @property
    def skeleton(self) -> Skeleton:
        """The figure that danced."""
        return skeleton_of(self.header)

    @property
    def puppets(self) -> list[str]:
        """The name of each puppet; "" of one without."""
        return list(self.header["puppets"])


@dataclass(frozen=True)
class JournalRecording:
    """A journal read back: its runs, oldest first; at least one of them has ticks."""

    runs: tuple[Run, ...]

    @property
    def header(self) -> dict[str, Any]:
        """Facts of the newest run."""
        return self.runs[-1].header

    @property
    def ticks(self) -> Ticks:
        """Ticks of the newest run, and of those in which the same figure danced with the same hands."""
        layout = self.runs[-1].ticks.dtype
        alike = [run.ticks for run in self.runs if run.ticks.dtype == layout]
        return np.concatenate(alike)

    @property
    def events(self) -> list[dict[str, Any]]:
        """Everything that happened, oldest first."""
        return [event for run in self.runs for _, event in run.events]

    @property
    def skeleton(self) -> Skeleton:
        """The figure that danced in the newest run."""
        return self.runs[-1].skeleton


def read_journal(path: Path) -> JournalRecording:
    """Read a journal, finished or torn off by a kill or a power cut. Raises JournalError with the reason."""
    parts: dict[str, _Part] = {}
    room = _Room(path)
    with uncollected():
        for name, data in segments_of(path):
            try:
                _add(parts, data, room)
            except DAMAGED as error:
                raise JournalError(
                    f"{path}: {name} is damaged ({error}). Remove it, and read the rest."
                ) from error
    try:
        runs = tuple(part.run() for part in parts.values() if part.has_ticks)
    except DAMAGED as error:
        raise JournalError(
            f"{path}: its ticks are no ticks of Bunraku ({error}). Export it again."
        ) from error
    if not runs:
        raise JournalError(f"{path}: nothing was recorded in it yet. Let the show dance, then look again.")
    return JournalRecording(runs)


def segments_of(path: Path) -> Iterator[tuple[str, bytes]]:
    """Names and bytes of a journal's segments, oldest first. Raises JournalError."""
    try:
        if path.is_dir():
            paths = segment_paths(path)
            if not paths:
                raise JournalError(f"{path}: no journal is in this folder. {_NAME_ONE}")
            for segment in paths:
                with contextlib.suppress(FileNotFoundError):  # the keeper let the oldest go meanwhile
                    yield segment.name, _read(segment)
            return
        with opened(path) as file:
            begin = file.read(512)
        if chunks.is_segment(begin):
            yield path.name, _read(path)
        elif begin[_USTAR[0]] == _USTAR[1]:
            yield from _exported(path)
        else:
            raise JournalError(_no_journal(path, begin))
    except OSError as error:
        raise JournalError(f"{path}: cannot be read ({error.strerror}). {_NAME_ONE}") from error
    except (tarfile.TarError, EOFError, *DAMAGED) as error:
        raise JournalError(f"{path}: cannot be read ({error}). Export the journal again.") from error


def header_of(data: bytes) -> dict[str, Any] | None:
    """The facts of the run that a segment belongs to; None where its begin is damaged.

    Raises what is raised for facts of something else.
    """
    first = next(chunks.chunks(data), None)
    if first is None or first.kind != chunks.HEADER:
        return None
    header: dict[str, Any] = json.loads(first.data)
    require_sound(header)
    return header


def last_saved(folder: Path, run: str) -> tuple[int, int]:
    """Number of the last entry and position of the last keyframe of a run that are on the disk: 0 and -1 for
    none. The run is the newest one that was kept. Raises OSError.
    """
    try:
        paths = segment_paths(folder)
    except FileNotFoundError:
        return 0, -1
    entries, keyframe = 0, -1
    for path in reversed(paths[-2:]):
        data = _read(path)
        with contextlib.suppress(*DAMAGED):
            header = header_of(data)
            if header is None or header["run"] != run:
                continue
            for one in chunks.chunks(data):
                if one.kind == chunks.KEYFRAME:
                    keyframe = max(keyframe, *log.POSITION.unpack_from(one.data))
                elif one.kind == chunks.LOG:
                    entries = max(entries, *(entry.number for entry in log.unpacked(one.data)))
    return max(entries, keyframe), keyframe


class _Room:
    """How much of a journal may still be held in memory."""

    def __init__(self, path: Path) -> None:
        self._path, self._left = path, _LEAST_ROOM

    def add_segment(self, stored: int) -> None:
        """The more is stored, the more may be held."""
        self._left += _OF_STORED * stored

    def take(self, size: int) -> None:
        """Raises JournalError when there is none left."""
        self._left -= size
        if self._left < 0:
            raise JournalError(
                f"{self._path}: it unpacks to more than a journal of its size can hold. Remove it, or name "
                "one of its segments; an exported file is a tar archive of them."
            )


class _Parts:
    """A file as an archive reads it: never more of it at once than a segment has."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self.tell, self.seek = file, file.tell, file.seek

    def read(self, size: int = -1) -> bytes:
        if not 0 <= size <= _LARGEST:
            raise tarfile.ReadError("a part of it is larger than any journal's")
        return self._file.read(size)


def _read(path: Path) -> bytes:
    return content(path, _LARGEST)


def _exported(path: Path) -> Iterator[tuple[str, bytes]]:
    with opened(path) as whole, tarfile.open(fileobj=_Parts(whole), mode="r:") as archive:  # type: ignore[call-overload]
        found = list(itertools.islice(archive, _MOST_SEGMENTS + 1))
        members = [one for one in found if one.isfile() and not one.issparse() and one.name.endswith(SUFFIX)]
        if not members:
            raise JournalError(f"{path}: no journal is in this archive. Name a file that was exported.")
        for member in sorted(members, key=lambda member: member.name):
            file = archive.extractfile(member)
            if file is None or member.size > _LARGEST or len(found) > _MOST_SEGMENTS:
                raise JournalError(f"{path}: a part of it is larger than any journal's. Export it again.")
            yield PurePosixPath(member.name).name, file.read()  # a foreign archive may name any folder


def _no_journal(path: Path, begin: bytes) -> str:
    if begin.startswith(_OLD_MAGIC):
        return f"{path}: a journal of an older release. Draw it with that release."
    return f"{path}: not a journal of Bunraku. {_NAME_ONE}"


@dataclass
class _Part:
    """A run that is being put together from its segments."""

    header: dict[str, Any]
    ticks: dict[int, bytes] = field(default_factory=dict)
    events: dict[int, dict[str, Any]] = field(default_factory=dict)
    keyframes: dict[int, bytes] = field(default_factory=dict)
    pieces: log.Pieces = field(default_factory=log.Pieces)
    piece_numbers: list[int] = field(default_factory=list)

    @property
    def has_ticks(self) -> bool:
        return bool(self.ticks)

    def run(self) -> Run:
        layout = layout_of(self.header)
        numbers = sorted(self.ticks)
        ticks = np.frombuffer(b"".join(self.ticks[number] for number in numbers), layout)
        return Run(
            self.header,
            ticks,
            np.array(numbers, dtype=np.uint64),
            sorted(self.events.items(), key=lambda event: event[0]),
            sorted(self.keyframes.items()),
            tuple(self.piece_numbers),
        )


def _add(parts: dict[str, _Part], data: bytes, room: _Room) -> None:
    """Add a segment to its run; one whose begin is torn has nothing in it yet."""
    header = header_of(data)
    if header is None:
        return
    room.add_segment(len(data))
    if header["run"] not in parts:
        room.take(_OF_JSON * len(json.dumps(header)))
    part = parts.setdefault(header["run"], _Part(header))
    tick_bytes = layout_of(header).itemsize
    for one in chunks.chunks(data):
        room.take(len(one.data))
        if one.kind == chunks.KEYFRAME:
            (position,) = log.POSITION.unpack_from(one.data)
            part.keyframes[position] = one.data[log.POSITION.size :]
        elif one.kind == chunks.LOG:
            for entry in log.unpacked(one.data):
                room.take(_OF_AN_ENTRY)
                if entry.kind == TICK:
                    if len(entry.data) != tick_bytes:
                        raise ValueError("a tick of another length")
                    part.ticks[entry.number] = entry.data
                elif entry.kind in (EVENT, PIECE):
                    room.take(_OF_JSON * len(entry.data))
                    if entry.kind == PIECE:
                        part.piece_numbers.append(entry.number)
                    event = entry.data if entry.kind == EVENT else part.pieces.whole(entry)
                    if event is not None:
                        part.events[entry.number] = _event(event)


def _event(data: bytes) -> dict[str, Any]:
    """Raises one of DAMAGED for an invalid one."""
    event: dict[str, Any] = json.loads(data)
    if not isinstance(event["kind"], str) or not isinstance(event.get("order", {}), dict):
        raise TypeError("an event of an unknown kind")
    return event | {"now": float(event["now"])}
