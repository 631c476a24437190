"""The place on the disk: two slots, each with its number and checksum, so that one is always whole."""

from __future__ import annotations

import contextlib
import errno
import os
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from appliance.box.checkpoint import FILE, LARGEST, Checkpoint, CheckpointReader, packed, unpacked
from appliance.box.durable import sync_folder

# A page: never shares a sector, nor the cell of a card that is being written, with the other.
SLOT_BYTES = 4096
SLOTS = 2
EVERY_S = 0.45  # with turns of half a second: each of them, and never more than a second is lost
RETRY_S = 10.0

_MAGIC = b"bkplace1"
_HEAD = struct.Struct("<8sQII")  # magic, number, payload's bytes, CRC-32 of everything in the slot but itself


class CheckpointFile:
    """One file, made in full when it is missing; a write changes the older slot alone and is then synced.

    A power cut in the middle of a write tears that slot; the other one still holds the place before.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = -1
        self._newest = 0

    def write(self, place: Checkpoint) -> None:
        """Put it on the disk, and wait until it is there. Raises OSError when it is not; then call again.

        The folder is made when it is missing. A file that was replaced (a disk mounted over it) is left.
        """
        try:
            self._open_here()
            slot = _slot(self._newest + 1, packed(place))
            at = (self._newest + 1) % SLOTS * SLOT_BYTES
            if os.pwrite(self._descriptor, slot, at) != len(slot):
                raise _no_space()
            os.fdatasync(self._descriptor)
        except OSError:
            self.close()  # the next try looks at what is really there
            raise
        self._newest += 1

    def close(self) -> None:
        """Let go of the file."""
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
        self._descriptor = -1

    def _open_here(self) -> None:
        """Have what the path leads to now open, whole, and know its newest number."""
        with contextlib.suppress(FileNotFoundError):
            if self._descriptor >= 0 and os.path.samestat(os.fstat(self._descriptor), self._path.lstat()):
                return
        self.close()
        flags = os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC
        with contextlib.suppress(FileNotFoundError):
            self._descriptor = os.open(self._path, flags)
            if os.fstat(self._descriptor).st_size == SLOTS * SLOT_BYTES:
                self._newest = max(_numbers(self._descriptor), default=0)
                return
            self.close()
        _make(self._path)
        self._descriptor, self._newest = os.open(self._path, flags), 0


def read_checkpoint(path: Path) -> Checkpoint | None:
    """The newest whole place of a file; None where there is none. Never raises."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError:
        return None
    try:
        found = {number: payload for number, payload in map(_read, _slots(descriptor)) if number}
    except OSError:
        return None
    finally:
        os.close(descriptor)
    places = (unpacked(found[number]) for number in sorted(found, reverse=True))
    return next((place for place in places if place is not None), None)


class CheckpointCarrier:
    """Carries the place from memory to the disk twice a second, in a process that may wait for a disk.

    failed: how often the disk did not take it; complaint: why it does not take it now, a sentence, else "".
    """

    fallback = "place-not-kept"

    def __init__(self, runtime: Path, state: Path, say: Callable[[str], None]) -> None:
        """runtime: the folder where the box's processes meet; state: the one on the disk."""
        self._reader = CheckpointReader(runtime)
        self._file = CheckpointFile(state / FILE)
        self._state, self._say = state, say
        self._written: Checkpoint | None = None
        self._due = 0.0
        self.failed = 0
        self.complaint = ""

    def turn(self, now: float) -> None:
        """Call it often; monotonic seconds. Waits as long as the disk does. Never raises."""
        if now >= self._due:
            self._due = now + self._carry()

    def last_turn(self) -> None:
        """Before the process ends: what is newest."""
        self._carry()
        self._reader.close()
        self._file.close()

    def _carry(self) -> float:
        """Write the place if it is new; seconds to wait until the next time."""
        place = self._reader.read()
        if place is None or replace(place, tick=0) == self._written:
            return EVERY_S
        try:
            self._file.write(place)
        except (OSError, ValueError) as error:
            self.failed += 1
            self._complain(error)
            return RETRY_S
        self._written = replace(place, tick=0)
        if self.complaint:
            self.complaint = ""
            self._say(f"{self._state}: the place of the dance is written there again.")
        return EVERY_S

    def _complain(self, error: OSError | ValueError) -> None:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        complaint = (
            f"{self._state}: the place of the dance cannot be written there ({reason}). The dance goes on, "
            "and after a crash too; after a power cut it begins at the beginning. Free or mend the disk, "
            "or give another folder as `state:` in the box file."
        )
        if complaint != self.complaint:
            self._say(complaint)
        self.complaint = complaint


def _make(path: Path) -> None:
    """The whole file at once, empty: later writes need no new room, and its name is on the disk."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.new")
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
    try:
        descriptor = os.open(temporary, flags, 0o600)
        try:
            empty = bytes(SLOTS * SLOT_BYTES)
            if os.write(descriptor, empty) != len(empty):
                raise _no_space()
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        temporary.rename(path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def _no_space() -> OSError:
    """For a disk that took a part and told no error."""
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _slot(number: int, payload: bytes) -> bytes:
    head = _HEAD.pack(_MAGIC, number, len(payload), 0)
    check = zlib.crc32(payload, zlib.crc32(head))
    return (_HEAD.pack(_MAGIC, number, len(payload), check) + payload).ljust(SLOT_BYTES, b"\0")


def _read(slot: bytes) -> tuple[int, bytes]:
    """Number and payload of a slot; number 0 where it is empty, torn or damaged."""
    if len(slot) < SLOT_BYTES:
        return 0, b""
    magic, number, length, check = _HEAD.unpack_from(slot)
    payload = slot[_HEAD.size : _HEAD.size + length]
    sound = zlib.crc32(payload, zlib.crc32(_HEAD.pack(magic, number, length, 0))) == check
    whole = magic == _MAGIC and length <= LARGEST and len(payload) == length
    return (number, payload) if sound and whole else (0, b"")


def _slots(descriptor: int) -> list[bytes]:
    return [os.pread(descriptor, SLOT_BYTES, slot * SLOT_BYTES) for slot in range(SLOTS)]


def _numbers(descriptor: int) -> list[int]:
    return [number for number, _ in map(_read, _slots(descriptor)) if number]
