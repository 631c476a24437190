"""Records: what must outlive a process (a block in memory) and the power (a file that the keeper writes)."""

from __future__ import annotations

import contextlib
import errno
import os
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

from appliance.box.block import BlockReader, BlockWriter
from appliance.box.durable import private_folder, write_whole
from appliance.pose.foreign_file import TooLargeError, content

# A page: never shares a sector, nor the cell of a card that is being written, with the other slot.
SLOT_BYTES = 4096
SLOTS = 2

_MAGIC = b"bkplace1"
_HEAD = struct.Struct("<8sQII")  # magic, number, payload's bytes, CRC-32 of everything in the slot but itself
SLOT_CAPACITY = SLOT_BYTES - _HEAD.size


class Record(NamedTuple):
    """name: of the block in the runtime folder, and of the file in the state folder; capacity: bytes.

    scope: what it is about; a block that was written for something else is not read.
    """

    name: str
    kind: str
    capacity: int
    scope: bytes = b""

    def writer(self, runtime: Path) -> BlockWriter:
        """The one process's that knows it. Raises OSError without room."""
        return BlockWriter(runtime / self.name, self.kind, self.capacity, scope=self.scope)

    def reader(self, runtime: Path) -> BlockReader:
        """For anyone else; its writer may be there or not."""
        return BlockReader(runtime / self.name, self.kind, scope=self.scope)


class WholeFile:
    """A record that people may read, edit and remove: replaced as a whole, private (mode 0600)."""

    def __init__(self, path: Path, largest: int) -> None:
        self._path, self._largest = path, largest

    def read(self) -> list[bytes]:
        """Its content, if there is a file. Raises OSError, and ValueError for one that is too large."""
        try:
            return [content(self._path, self._largest)]
        except (FileNotFoundError, NotADirectoryError):
            return []
        except TooLargeError as error:
            raise ValueError(error.strerror) from None

    def write(self, payload: bytes) -> None:
        """Wait until it is on the disk. Raises OSError; then the file is as it was."""
        write_whole(self._path, payload, private=True)

    def close(self) -> None:
        """Nothing is open."""


class SlotFile:
    """A record that changes all the time: two slots with number and checksum, one of them always whole.

    The file is made in full when it is missing, so that a disk that fills up later still takes each write. A
    write changes only the older slot; a power cut in the middle of it leaves the newer one.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = -1
        self._newest = 0

    def read(self) -> list[bytes]:
        """Its intact contents, the newest first. Never raises."""
        try:
            descriptor = os.open(self._path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
        except OSError:
            return []
        try:
            return [payload for _, payload in sorted(_slots(descriptor), reverse=True)]
        except OSError:
            return []
        finally:
            os.close(descriptor)

    def write(self, payload: bytes) -> None:
        """Wait until it is on the disk; a file that was replaced (a disk mounted over it) is left.

        Raises OSError, and ValueError for what is longer than a slot; then the newest payload is still there.
        """
        if len(payload) > SLOT_CAPACITY:
            raise ValueError(f"{len(payload)} bytes are more than the {SLOT_CAPACITY} of a slot.")
        try:
            self._open_current()
            slot = _slot(self._newest + 1, payload)
            at = (self._newest + 1) % SLOTS * SLOT_BYTES
            if os.pwrite(self._descriptor, slot, at) != len(slot):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fdatasync(self._descriptor)
        except OSError:
            self.close()  # the next try looks at what is really there
            raise
        self._newest += 1

    def close(self) -> None:
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
        self._descriptor = -1

    def _open_current(self) -> None:
        """Open what the path leads to now, and find its newest number."""
        with contextlib.suppress(FileNotFoundError):
            if self._descriptor >= 0 and os.path.samestat(os.fstat(self._descriptor), self._path.lstat()):
                return
        self.close()
        flags = os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC
        with contextlib.suppress(FileNotFoundError):
            self._descriptor = os.open(self._path, flags)
            if os.fstat(self._descriptor).st_size == SLOTS * SLOT_BYTES:
                self._newest = max((number for number, _ in _slots(self._descriptor)), default=0)
                return
            self.close()
        private_folder(self._path.parent)
        write_whole(self._path, bytes(SLOTS * SLOT_BYTES), private=True)
        self._descriptor, self._newest = os.open(self._path, flags), 0


def _slot(number: int, payload: bytes) -> bytes:
    head = _HEAD.pack(_MAGIC, number, len(payload), 0)
    check = zlib.crc32(payload, zlib.crc32(head))
    return (_HEAD.pack(_MAGIC, number, len(payload), check) + payload).ljust(SLOT_BYTES, b"\0")


def _slots(descriptor: int) -> list[tuple[int, bytes]]:
    """Number and payload of each slot that is neither empty nor torn nor damaged."""
    found = []
    for at in range(0, SLOTS * SLOT_BYTES, SLOT_BYTES):
        slot = os.pread(descriptor, SLOT_BYTES, at)
        if len(slot) == SLOT_BYTES:
            magic, number, length, check = _HEAD.unpack_from(slot)
            payload = slot[_HEAD.size : _HEAD.size + length]
            is_sound = zlib.crc32(payload, zlib.crc32(_HEAD.pack(magic, number, length, 0))) == check
            if number and magic == _MAGIC and len(payload) == length and is_sound:
                found.append((number, payload))
    return found
