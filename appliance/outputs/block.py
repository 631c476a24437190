"""Blocks: bytes that one process writes and any number of others read, whole or not at all."""

from __future__ import annotations

from pathlib import Path


class BlockWriter:
    """A small file of one kind with the newest payload in it, at most `capacity` bytes.

    Continues a sound file of the same kind (readers notice nothing), otherwise or when `fresh` puts a new one
    in its place. Raises OSError where the folder takes no file.
    """

    def __init__(self, path: Path, kind: str, capacity: int, fresh: bool = False) -> None:
        raise NotImplementedError

    def write(self, payload: bytes) -> None:
        """Publish; raises ValueError above the capacity."""

    def close(self) -> None:
        """Let go of the file; it stays, with its last payload."""


class BlockReader:
    """Reads what a BlockWriter of the same kind wrote; finds a file that was replaced by itself.

    complaint: why there is nothing to read although there is a file, in a sentence; else empty.
    """

    def __init__(self, path: Path, kind: str) -> None:
        raise NotImplementedError

    def read(self) -> bytes | None:
        """The newest whole payload; None without one. Never waits, never raises."""

    def close(self) -> None:
        """Let go of the file."""
