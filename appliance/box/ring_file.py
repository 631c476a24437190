"""Files of rings in the runtime folder: which kind and format they are, whether their writer lives."""

from __future__ import annotations

import contextlib
import fcntl
import mmap
import os
import struct
import time
import zlib
from collections.abc import Sequence
from pathlib import Path

from appliance.box.ring import Ring, RingReader, RingWriter
from appliance.box.runtime_folder import hold, is_lost

Shape = tuple[int, int]  # slots and capacity of a ring, bytes

_MAGIC = b"bunraku\n"
_HEADER = struct.Struct("<8s16sII")  # magic, kind, format, number of rings: the same in every format
_SHAPE = struct.Struct("<II")
_CHECK = struct.Struct("<I")  # CRC-32 of header and shapes
_MOST_RINGS = 8
_LARGEST_PAYLOAD = 1 << 24  # bytes; a reader takes a slot at once, however much of it was written
_LONGEST = _HEADER.size + _MOST_RINGS * _SHAPE.size + _CHECK.size
_LOCK_TRIES, _LOCK_RETRY_S = 10, 0.01  # a check whether a writer lives holds the lock for a moment


class RingFileWriter:
    """A mapped file with rings, locked (flock) for as long as its writer lives."""

    def __init__(self, path: Path, descriptor: int, rings: Sequence[Ring]) -> None:
        self._path = path
        self._descriptor = descriptor
        self._memory = _mapped(descriptor, rings[-1].end)
        self.rings = [RingWriter(ring, self._memory) for ring in rings]

    @classmethod
    def new(cls, path: Path, kind: str, version: int, shapes: Sequence[Shape]) -> RingFileWriter:
        """A file that readers do not find before `publish`. Raises OSError where there is no room for it.

        Deletes temporary files left by writers that died before publishing.
        """
        _clear_up(path)
        temporary = _temporary(path)
        header = _header(kind, version, shapes)
        rings = _rings(shapes)
        with contextlib.ExitStack() as failing:
            descriptor = _made(temporary)
            failing.callback(temporary.unlink, missing_ok=True)
            failing.callback(os.close, descriptor)
            os.posix_fallocate(descriptor, 0, rings[-1].end)  # a full disk is found here, not by a tick
            os.pwrite(descriptor, header, 0)
            made = cls(path, descriptor, rings)
            failing.pop_all()
        return made

    @classmethod
    def resumed(cls, path: Path, kind: str, version: int, shapes: Sequence[Shape]) -> RingFileWriter | None:
        """The file that an earlier writer left, to be written on; None where there is no sound one.

        Raises BlockingIOError while its writer lives, OSError where it cannot be opened.
        """
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
        except FileNotFoundError:
            return None
        header, rings = _header(kind, version, shapes), _rings(shapes)
        with contextlib.ExitStack() as failing:
            failing.callback(os.close, descriptor)
            if os.pread(descriptor, len(header), 0) != header or not _are_whole(descriptor, rings):
                return None
            _lock(descriptor)
            found = cls(path, descriptor, rings)
            failing.pop_all()
        hold(found)
        return found

    def publish(self) -> None:
        """Put a new file in the place of the one before: from now on readers find it."""
        _temporary(self._path).rename(self._path)
        hold(self)

    def renew(self) -> bool:
        """A file that was deleted is put there again with all that it holds, and written on.

        Whether it was. Raises OSError where there is no room for it.
        """
        if self._descriptor < 0 or not is_lost(self._path):
            return False
        temporary, size = _temporary(self._path), len(self._memory)
        with contextlib.ExitStack() as failing:
            descriptor = _made(temporary)
            failing.callback(temporary.unlink, missing_ok=True)
            failing.callback(os.close, descriptor)
            os.posix_fallocate(descriptor, 0, size)
            memory = _mapped(descriptor, size)
            memory[:] = memoryview(self._memory)  # no third copy: the stage waits for it
            temporary.rename(self._path)
            failing.pop_all()
        for ring in self.rings:
            ring.move_to(memory)
        self._let_go()
        self._memory, self._descriptor = memory, descriptor
        return True

    def close(self, remove: bool = False) -> None:
        """Release the file; `remove`: it goes too, unless another one has taken its place."""
        if self._descriptor < 0:
            return
        with contextlib.suppress(OSError):
            if remove and os.path.samestat(os.fstat(self._descriptor), self._path.stat()):
                self._path.unlink()
        self._let_go()
        self._descriptor = -1

    def _let_go(self) -> None:
        fcntl.flock(self._descriptor, fcntl.LOCK_UN)  # the mapping holds on to the file, and to its lock
        os.close(self._descriptor)


class RingFileReader:
    """Follows a path in the runtime folder from file to file. Nothing here raises.

    rings: of the file that is open; none without a readable one. is_there: whether the path led to a file at
    the last look. complaint: why that cannot be read, a sentence; else empty. `writer`: what people call it.
    """

    def __init__(self, path: Path, kind: str, version: int, writer: str) -> None:
        self._path, self._kind, self._version, self._writer = path, kind, version, writer
        self._descriptor = -1
        self._identity: tuple[int, int] | None = None
        self.rings: list[RingReader] = []
        self.is_there = False
        self.complaint = ""

    def look(self) -> bool:
        """Open what the path leads to now; True when that is another file than the open one.

        A file that is gone stays open: its last payloads can be read until there is a new one.
        """
        try:
            found = self._path.stat()
        except OSError:
            self.is_there, self.complaint = False, ""
            return False
        self.is_there = True
        if (found.st_dev, found.st_ino) == self._identity:
            return False
        try:
            descriptor = os.open(self._path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
        except OSError as error:
            self.complaint = f"{self._path} cannot be read ({error.strerror})."
            return False
        self.close()
        self._descriptor = descriptor
        self._identity = found.st_dev, found.st_ino  # no other file gets this pair while this one is open
        self.complaint = self._understand(descriptor)
        return True

    def writer_lives(self) -> bool:
        """Whether the process that made the open file still has it."""
        if self._descriptor < 0:
            return False
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
        fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        return False

    def refuse(self, reason: str) -> None:
        """Read nothing more from this file: `reason` is a clause about it."""
        self.rings = []
        self.complaint = f"{self._path} {reason}"

    def close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor, self._identity, self.rings = -1, None, []

    def _understand(self, descriptor: int) -> str:
        """Find the rings; or why there are none, in a sentence."""
        try:
            header = os.pread(descriptor, _LONGEST, 0)
        except OSError as error:
            return f"{self._path} cannot be read ({error.strerror})."
        if len(header) < _LONGEST:
            return f"{self._path} was cut short. Start {self._writer} again."
        magic, kind, version, count = _HEADER.unpack_from(header)
        if magic != _MAGIC or kind.rstrip(b"\0") != self._kind.encode():
            return f"{self._path} was not written by {self._writer}. Remove it."
        if version != self._version:
            older = "this program" if version > self._version else self._writer
            return (
                f"{self._path} has format {version}, and this program reads format {self._version}. "
                f"Update {older}: both must come from one release."
            )
        end = _HEADER.size + min(count, _MOST_RINGS) * _SHAPE.size
        if _CHECK.unpack_from(header, end) != (zlib.crc32(header[:end]),):
            return f"{self._path} is damaged. Start {self._writer} again."
        shapes = list(_SHAPE.iter_unpack(header[_HEADER.size : end]))
        if not all(slots and capacity <= _LARGEST_PAYLOAD for slots, capacity in shapes):
            return f"{self._path} is damaged. Start {self._writer} again."
        self.rings = [RingReader(ring, descriptor) for ring in _rings(shapes)]
        return ""


def _mapped(descriptor: int, size: int) -> mmap.mmap:
    return mmap.mmap(descriptor, size, mmap.MAP_SHARED | mmap.MAP_POPULATE)


def _header(kind: str, version: int, shapes: Sequence[Shape]) -> bytes:
    header = _HEADER.pack(_MAGIC, kind.encode(), version, len(shapes))
    header += b"".join(_SHAPE.pack(*shape) for shape in shapes)
    return (header + _CHECK.pack(zlib.crc32(header))).ljust(_LONGEST, b"\0")


def _rings(shapes: Sequence[Shape]) -> list[Ring]:
    """One behind the other, after the header."""
    rings: list[Ring] = []
    for slots, capacity in shapes:
        rings.append(Ring(rings[-1].end if rings else 128, slots, capacity))
    return rings


def _are_whole(descriptor: int, rings: Sequence[Ring]) -> bool:
    """Whether a file is as long as its rings and the newest payload of each is there."""
    if os.fstat(descriptor).st_size != rings[-1].end:
        return False
    for reader in (RingReader(ring, descriptor) for ring in rings):
        sequence = reader.newest_sequence()
        if sequence and reader.payload(sequence) is None:
            return False
    return True


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}")


def _made(temporary: Path) -> int:
    """A file of ours, empty and locked; made again where `_clear_up` took it before it was locked."""
    flags = os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
    while True:
        descriptor = os.open(temporary, flags, 0o600)
        with contextlib.ExitStack() as leaving:
            leaving.callback(os.close, descriptor)
            _lock(descriptor)
            if os.fstat(descriptor).st_nlink:
                leaving.pop_all()
                return descriptor


def _lock(descriptor: int) -> None:
    """Be its writer; raises BlockingIOError where another one lives."""
    for _ in range(_LOCK_TRIES - 1):
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        time.sleep(_LOCK_RETRY_S)
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _clear_up(path: Path) -> None:
    """Remove what was never published, of writers that do not live. Never raises."""
    beginning = f".{path.name}."
    for left in path.parent.glob(f"{beginning}*"):
        if not left.name.removeprefix(beginning).isdigit():
            continue
        with contextlib.suppress(OSError), contextlib.ExitStack() as looking:
            descriptor = os.open(left, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
            looking.callback(os.close, descriptor)
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            left.unlink()
