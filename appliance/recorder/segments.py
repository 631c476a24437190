"""The journal on the disk: a folder of append-only segment files, bounded by time and by the disk's room."""

from __future__ import annotations

import contextlib
import errno
import os
from collections import deque
from pathlib import Path

from appliance.box.durable import private_folder
from appliance.pose.whole_file import sync
from appliance.recorder.chunks import count_ticks

SUFFIX = ".segment"
SEGMENT_TICKS = 3000  # a minute
LEAST_FREE_BYTES, LEAST_FREE_SHARE = 32 << 20, 0.05  # bytes or share, whichever is less


def segment_paths(folder: Path) -> list[Path]:
    """All segments of a folder, oldest first; other entries are skipped. Raises OSError."""
    found = (path for path in folder.iterdir() if path.name.endswith(SUFFIX) and path.is_file())
    numbered = [(_number(path.name), path) for path in found]
    return [path for _, path in sorted((number, path) for number, path in numbered if number is not None)]


class Segments:
    """Appends to the newest segment; the oldest ones go when there is more than `most_ticks` or no room.

    Everything here raises OSError when the disk does not take it; then `forget`, and begin a new segment.
    """

    def __init__(self, folder: Path, most_ticks: int) -> None:
        self._folder = folder
        self._most_ticks = most_ticks
        self._older: deque[tuple[Path, int]] | None = None  # and the ticks in each; None: not read yet
        self._path: Path | None = None
        self._descriptor = -1
        self._is_tight = False
        self.ticks = 0  # in the segment that is open

    @property
    def is_complete(self) -> bool:
        """Whether the next keyframe should begin a new segment. Where room is short they are small: then the
        oldest seconds can go for the newest ones, and a minute is always there.
        """
        return self.ticks >= SEGMENT_TICKS or self._is_tight

    @property
    def is_open(self) -> bool:
        """Whether there is a segment to append to."""
        return self._descriptor >= 0

    def begin(self) -> None:
        """Start a new segment; the one before is complete."""
        self.finish()
        older = self._read_folder()
        number = 1 + max((_number(path.name) or 0 for path, _ in older), default=0)
        path = self._folder / f"{number:08d}{SUFFIX}"
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_NOFOLLOW | os.O_CLOEXEC
        try:
            self._descriptor = os.open(path, flags, 0o600)
        except FileExistsError:
            self._older = None  # another keeper writes here: read the folder again
            raise
        self._path = path
        sync(self._folder)

    def append(self, data: bytes, ticks: int) -> None:
        """Write it behind the rest, and wait until it is on the disk."""
        self._make_room(len(data))
        written = os.write(self._descriptor, data)
        if written != len(data):  # a part of it found room
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.fdatasync(self._descriptor)
        self.ticks += ticks

    def finish(self) -> None:
        """The segment is complete."""
        if self._path is not None and self._older is not None:
            self._older.append((self._path, self.ticks))
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
        self._descriptor, self._path, self.ticks = -1, None, 0

    def forget(self) -> None:
        """After an error: the folder may have changed, read it again."""
        self.finish()
        self._older = None

    def _read_folder(self) -> deque[tuple[Path, int]]:
        if self._older is None:
            private_folder(self._folder)
            paths = segment_paths(self._folder)
            self._older = deque((path, count_ticks(path)) for path in paths)
        return self._older

    def _make_room(self, size: int) -> None:
        """Let the oldest segments go, but for the newest minute; raises OSError when that is not enough."""
        older = self._read_folder()
        kept = self.ticks + sum(ticks for _, ticks in older)
        while older and kept - older[0][1] >= self._most_ticks:
            kept -= older[0][1]
            self._remove_oldest()
        while not self._has_room(size):
            self._is_tight = True
            if not older or kept - older[0][1] < SEGMENT_TICKS:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            kept -= older[0][1]
            self._remove_oldest()

    def _remove_oldest(self) -> None:
        assert self._older
        with contextlib.suppress(FileNotFoundError):
            self._older[0][0].unlink()
        self._older.popleft()

    def _has_room(self, size: int) -> bool:
        disk = os.statvfs(self._folder)
        least = min(LEAST_FREE_BYTES, int(LEAST_FREE_SHARE * disk.f_blocks * disk.f_frsize))
        return disk.f_bavail * disk.f_frsize >= least + size


def _number(name: str) -> int | None:
    stem = name.removesuffix(SUFFIX)
    return int(stem) if stem.isdecimal() else None
