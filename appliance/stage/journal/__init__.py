"""The flight recorder: a memory-mapped ring of ticks that survives the process and is read after the show."""

from __future__ import annotations

import contextlib
import ctypes
import json
import mmap
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appliance.pose.skeleton import Skeleton
from appliance.stage.clock import TICK_S

LATE, NOT_FINITE, JUMPED, SILENT = 1, 2, 4, 8  # flags of a tick
SECTIONS = ("drain", "puppeteers", "motion", "puppet", "blend", "figure", "send")

_MAGIC = b"bunraku journal 1\n"
_HEADER_BYTES = 65536
_CHUNK_TICKS = 512  # the journal lets go of its memory in pieces of this many ticks


class JournalError(Exception):
    """A journal that cannot be written or read; the message says why and what to do."""


@dataclass(frozen=True)
class JournalRecording:
    """A journal read back: `header` as written, `ticks` a structured array in order of time."""

    header: dict[str, Any]
    ticks: np.ndarray[Any, np.dtype[np.void]]

    @property
    def skeleton(self) -> Skeleton:
        """The figure that danced."""
        return Skeleton(
            tuple(self.header["joints"]),
            tuple(self.header["parents"]),
            np.asarray(self.header["offsets"], np.float64),
            tuple((int(joint), (float(x), float(y), float(z))) for joint, (x, y, z) in self.header["ends"]),
        )


class Journal:
    """Writes one fixed-size record a tick into a file that was allocated in full when it was opened.

    A record's `written` number goes in last, so that one torn by a kill is recognised and left out.
    """

    def __init__(
        self, path: Path, skeleton: Skeleton, hands: Sequence[dict[str, Any]], minutes: float
    ) -> None:
        self.path = path
        dtype = _record(len(skeleton.names), len(hands))
        self.capacity = max(_CHUNK_TICKS, int(minutes * 60.0 / TICK_S))
        header = _header(skeleton, hands, self.capacity, dtype)
        self._map = _mapped(path, header, _HEADER_BYTES + self.capacity * dtype.itemsize)
        ring = np.frombuffer(self._map, dtype, self.capacity, _HEADER_BYTES)
        self._itemsize = dtype.itemsize
        self._written = 0
        self.field: dict[str, np.ndarray[Any, Any]] = {name: ring[name] for name in dtype.names or ()}
        self.row = 0

    def commit(self) -> None:
        """The fields at `row` are complete: number them, and move on to the next row."""
        self._written += 1
        self.field["written"][self.row] = self._written
        self.row = self._written % self.capacity
        if self.row % _CHUNK_TICKS == 0:
            self._let_go()

    def unlock(self) -> None:
        """Call after memory was locked: the journal alone must not be, or all of it would stay resident."""
        anchor = ctypes.c_char.from_buffer(self._map)
        address, size = ctypes.c_void_p(ctypes.addressof(anchor)), ctypes.c_size_t(len(self._map))
        ctypes.CDLL(None).munlock(address, size)

    def close(self) -> None:
        """Unmap; what was written stays in the file."""
        self.field.clear()
        self._map.close()

    def _let_go(self) -> None:
        """Drop the last pieces from resident memory; the kernel keeps them for the file."""
        last = _HEADER_BYTES + ((self.row - 1) % self.capacity) * self._itemsize
        first = max(0, last - 2 * _CHUNK_TICKS * self._itemsize) // mmap.PAGESIZE * mmap.PAGESIZE
        with contextlib.suppress(OSError):
            self._map.madvise(mmap.MADV_DONTNEED, first, last - first)


def read_journal(path: Path) -> JournalRecording:
    """Read a journal, finished or torn off by a kill or a power cut. Raises JournalError with the reason."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise JournalError(
            f"{path}: cannot be read ({error.strerror}). Name the journal of a run."
        ) from error
    if not data.startswith(_MAGIC) or len(data) <= _HEADER_BYTES:
        raise JournalError(
            f"{path}: not a journal of Bunraku. Name a file written by `bunraku play --journal`."
        )
    try:
        header = json.loads(data[len(_MAGIC) : _HEADER_BYTES].rstrip(b"\0"))
        dtype = np.dtype([(name, form, tuple(shape)) for name, form, shape in header["record"]])
    except (ValueError, KeyError, TypeError) as error:
        raise JournalError(f"{path}: its header is damaged ({error}). The journal cannot be read.") from error
    count = min(int(header["capacity"]), (len(data) - _HEADER_BYTES) // dtype.itemsize)
    ring = np.frombuffer(data, dtype, count, _HEADER_BYTES)
    ticks = ring[ring["written"] > 0]
    return JournalRecording(header, ticks[np.argsort(ticks["written"], kind="stable")])


def _record(joints: int, hands: int) -> np.dtype[np.void]:
    return np.dtype(
        [
            ("tick", "<i8"),
            ("frame_time", "<f8"),
            ("started", "<f8"),
            ("sensor_sequence", "<i8"),
            ("sensor_arrival", "<f8"),
            ("flags", "<u4"),
            ("skipped", "<u4"),
            ("coding_iterations", "<u2"),
            ("interaction_iterations", "<u2"),
            ("sections_ms", "<f4", (len(SECTIONS),)),
            ("targets", "<f4", (hands, 4)),
            ("weights", "<f4", (hands,)),
            ("root", "<f4", (3,)),
            ("pose", "<f4", (joints, 4)),
            ("written", "<u8"),
        ]
    )


def _header(
    skeleton: Skeleton, hands: Sequence[dict[str, Any]], capacity: int, record: np.dtype[np.void]
) -> bytes:
    """Facts of the run as JSON, with the record's fields: whoever reads the file needs no other knowledge."""
    fields = [(name, record[name].base.str, record[name].shape) for name in record.names or ()]
    facts = {
        "capacity": capacity,
        "header_bytes": _HEADER_BYTES,
        "record": fields,
        "tick_s": TICK_S,
        "sections": SECTIONS,
        "hands": list(hands),
        "joints": skeleton.names,
        "parents": [int(parent) for parent in skeleton.parents],
        "offsets": np.asarray(skeleton.offsets).tolist(),
        "ends": [(joint, list(offset)) for joint, offset in skeleton.ends],
    }
    header = _MAGIC + json.dumps(facts).encode()
    if len(header) > _HEADER_BYTES:
        raise JournalError(
            f"The skeleton of {len(skeleton.names)} joints is too large for a journal's header."
        )
    return header.ljust(_HEADER_BYTES, b"\0")


def _mapped(path: Path, header: bytes, size: int) -> mmap.mmap:
    """Allocate the whole file now: a full disk is found here, never by a tick."""
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
        try:
            os.posix_fallocate(descriptor, 0, size)
            os.pwrite(descriptor, header, 0)
            mapped = mmap.mmap(descriptor, size)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise JournalError(
            f"{path}: no journal ({error.strerror}; it needs {size / 1e6:.0f} MB). "
            "The dance runs without one. Free the disk, choose another place or lower journal.minutes."
        ) from error
    return mapped
