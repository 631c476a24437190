"""Rings: sequence-locked slots in memory that one process writes and any number of others read."""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

_HEAD = struct.Struct("<QII")  # sequence, payload's bytes, CRC-32
_TAIL = struct.Struct("<Q")  # the sequence again
_LINE = 64  # bytes: no slot shares a cache line with another
_TRIES = 4
_WHOLE = slice(None)  # made once: a slice is an object that the collector visits


@dataclass(frozen=True)
class Ring:
    """Layout of a ring in its file: `slots` places for payloads of at most `capacity` bytes.

    It begins with the newest sequence (64-bit, little-endian; 0: nothing was written yet). Payload n is in
    slot n modulo `slots`, with n at both of its ends and the CRC-32 of its bytes, which starts from n.
    Readers need all three: neither Python nor the processor (ARM) promises in which order another process
    sees what was written, so a slot is taken for whole only when it proves to be.
    """

    at: int
    slots: int
    capacity: int

    @property
    def slot_bytes(self) -> int:
        """Bytes of one slot, whole cache lines."""
        return -(-(_HEAD.size + self.capacity + _TAIL.size) // _LINE) * _LINE

    @property
    def end(self) -> int:
        """The first byte behind it."""
        return self.at + _LINE + self.slots * self.slot_bytes

    def slot_at(self, sequence: int) -> int:
        """Where the slot of this payload begins."""
        return self.at + _LINE + sequence % self.slots * self.slot_bytes


class RingWriter:
    """Fill `payload`, then `publish`: one copy into the next slot; what was written before stays whole."""

    def __init__(self, ring: Ring, memory: mmap.mmap) -> None:
        self._ring = ring
        self.move_to(memory)
        self._image = bytearray(ring.slot_bytes)
        self._tail_at = ring.slot_bytes - _TAIL.size
        self.payload = memoryview(self._image)[_HEAD.size : _HEAD.size + ring.capacity]
        self._sequence = self._newest[0]

    def move_to(self, memory: mmap.mmap) -> None:
        """From now on write into this file, which has the same content."""
        whole, ring = memoryview(memory), self._ring
        self._newest = whole[ring.at : ring.at + _TAIL.size].cast("Q")
        starts = map(ring.slot_at, range(ring.slots))
        self._slots = [whole[start : start + ring.slot_bytes] for start in starts]

    def publish(self) -> None:
        """Make the whole payload the newest one; nothing here is for the collector to visit."""
        self._publish(self.payload)

    def write(self, payload: bytes) -> None:
        """Publish a payload of any length up to the capacity; raises ValueError above it."""
        if len(payload) > len(self.payload):
            raise ValueError(f"{len(payload)} bytes do not fit a slot of {len(self.payload)}")
        self.payload[: len(payload)] = payload
        self._publish(self.payload[: len(payload)])

    def _publish(self, payload: memoryview) -> None:
        self._sequence = sequence = self._sequence + 1
        check = zlib.crc32(payload, sequence & 0xFFFFFFFF)
        _HEAD.pack_into(self._image, 0, sequence, len(payload), check)
        _TAIL.pack_into(self._image, self._tail_at, sequence)
        self._slots[sequence % len(self._slots)][_WHOLE] = self._image
        self._newest[0] = sequence


class RingReader:
    """Reads a ring by system calls: a file cut short then gives less bytes, and memory would kill us."""

    def __init__(self, ring: Ring, descriptor: int) -> None:
        self._ring = ring
        self._descriptor = descriptor

    def newest(self) -> tuple[int, bytes] | None:
        """Sequence and payload of the newest whole slot; None before the first one."""
        for _ in range(_TRIES):
            sequence = self.newest_sequence()
            payload = self.payload(sequence)
            if payload is not None:
                return sequence, payload
        return next(self._older(sequence), None)

    def newest_sequence(self) -> int:
        """The number written last; 0: nothing yet."""
        return int.from_bytes(self._read(8, self._ring.at), "little")

    def payload(self, sequence: int) -> bytes | None:
        """The payload of this number if it is still there, and whole."""
        if sequence == 0:
            return None
        slot = self._read(self._ring.slot_bytes, self._ring.slot_at(sequence))
        if len(slot) < self._ring.slot_bytes:
            return None
        at_head, length, check = _HEAD.unpack_from(slot)
        (at_tail,) = _TAIL.unpack_from(slot, len(slot) - _TAIL.size)
        if at_head != sequence or at_tail != sequence or length > self._ring.capacity:
            return None
        payload = slot[_HEAD.size : _HEAD.size + length]
        return payload if zlib.crc32(payload, sequence & 0xFFFFFFFF) == check else None

    def _older(self, sequence: int) -> Iterator[tuple[int, bytes]]:
        """The intact payloads before this one, newest first."""
        for older in range(sequence - 1, max(sequence - self._ring.slots, 0), -1):
            payload = self.payload(older)
            if payload is not None:
                yield older, payload

    def _read(self, size: int, at: int) -> bytes:
        try:
            return os.pread(self._descriptor, size, at)
        except OSError:
            return b""
