"""Blocks: bytes that one process writes and any number of others read, whole or not at all."""

from __future__ import annotations

from pathlib import Path

from appliance.box.ring_file import RingFileReader, RingFileWriter

_SLOTS = 2  # while one is written, the other one holds what was there before


class BlockWriter:
    """A small file of one kind with the newest payload in it, at most `capacity` bytes.

    Continues a sound file of the same kind (readers notice nothing), otherwise or when `fresh` puts a new one
    in its place. `scope`: what the payloads are about; readers of another scope find none. Raises
    BlockingIOError while another process writes the one to continue, OSError where the folder takes no file.
    """

    def __init__(
        self,
        path: Path,
        kind: str,
        capacity: int,
        fresh: bool = False,
        version: int = 1,
        scope: bytes = b"",
    ) -> None:
        self._prefix = _prefix(scope)
        shapes = [(_SLOTS, len(self._prefix) + capacity)]
        resumed = None if fresh else RingFileWriter.resumed(path, kind, version, shapes)
        self._file = resumed or RingFileWriter.new(path, kind, version, shapes)
        if resumed is None:
            self._file.publish()

    def write(self, payload: bytes) -> None:
        """Publish; raises ValueError above the capacity."""
        self._file.rings[0].write(self._prefix + payload)

    def close(self) -> None:
        """Release the file; it stays, with its last payload."""
        self._file.close()


class BlockReader:
    """Reads what a BlockWriter of the same kind wrote; finds a file that was replaced by itself.

    A file that is gone is read on until there is another one: its writer may still be at work in it.
    `writer`: what people call the program that writes it.
    """

    def __init__(
        self, path: Path, kind: str, version: int = 1, writer: str = "its writer", scope: bytes = b""
    ) -> None:
        self._prefix = _prefix(scope)
        self._file = RingFileReader(path, kind, version, writer)

    @property
    def complaint(self) -> str:
        """Why nothing is read although there is a file, in a sentence; else empty."""
        return self._file.complaint

    def writer_lives(self) -> bool:
        """Whether the process that wrote what was read last still has the file."""
        return self._file.writer_lives()

    def read(self) -> bytes | None:
        """The newest whole payload; None before the first of this scope. Never waits, never raises."""
        self._file.look()
        newest = self._file.rings[0].newest() if self._file.rings else None
        if newest is None or not newest[1].startswith(self._prefix):
            return None
        return newest[1][len(self._prefix) :]

    def close(self) -> None:
        self._file.close()


def _prefix(scope: bytes) -> bytes:
    return scope + b"\0" if scope else b""
