"""Files that are whole or not there, and on the disk when a call returns, even if the power is cut next."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from appliance.pose.whole_file import sync

_LOCK_RETRY_S = 0.02


def private_folder(folder: Path) -> None:
    """Make a folder, and the folders above it that are missing, each for this user only (mode 0700).

    `Path.mkdir(mode, parents=True)` gives its mode to the last folder only. Raises OSError.
    """
    try:
        folder.mkdir(mode=0o700)
    except FileNotFoundError:
        private_folder(folder.parent)
        private_folder(folder)
    except FileExistsError:
        if not folder.is_dir():
            raise


def write_whole(path: Path, content: bytes, private: bool = False) -> None:
    """Replace what `path` holds; raises OSError, and then `path` is as it was. private: mode 0600."""
    with replacing(path, private) as stream:
        stream.write(content)


@contextlib.contextmanager
def replacing(path: Path, private: bool = False) -> Iterator[BinaryIO]:
    """The same for content that is written piece by piece; after any error `path` is as it was."""
    part = beside(path)
    part.unlink(missing_ok=True)  # an earlier try left it
    with new_file(part, path if private else None) as stream:
        yield stream
    put_in_place(part, path)


def beside(path: Path) -> Path:
    """Where the new content of `path` is written before it takes its place.

    Its ending is another: a search for files of a kind does not find one that a power cut left half-written.
    """
    return path.with_name(f".{path.name}.new")


def write_beside(path: Path, content: bytes, private: bool = False) -> Path:
    """Write `content` to the disk beside `path`, ready for `put_in_place`. Raises OSError."""
    part = beside(path)
    part.unlink(missing_ok=True)
    with new_file(part, path if private else None) as stream:
        stream.write(content)
    return part


def put_in_place(part: Path, path: Path) -> None:
    """Rename the file beside `path` to `path`; raises OSError, and then the file beside it is gone."""
    try:
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
    sync(path.parent)


@contextlib.contextmanager
def new_file(path: Path, owner_of: Path | None = None) -> Iterator[BinaryIO]:
    """A file to be written, on the disk at the end; removed after any error. Raises FileExistsError.

    owner_of: the file is private (mode 0600), and belongs to the owner of this one, or of its folder.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    descriptor = os.open(path, flags, 0o666 if owner_of is None else 0o600)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            if owner_of is not None:
                os.fchmod(descriptor, 0o600)  # whatever the umask
                _give_to_owner(descriptor, owner_of)
            yield stream
            stream.flush()
            os.fsync(descriptor)
    except BaseException:
        with contextlib.suppress(OSError):
            path.unlink()
        raise


@contextlib.contextmanager
def alone_in(folder: Path, patience_s: float = 0.0) -> Iterator[None]:
    """One process at a time in a folder, even a read-only one; without the folder there is nothing to guard.

    Raises BlockingIOError where another process does not leave within `patience_s`: it may hang on a disk.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:
        yield
        return
    try:
        _lock(descriptor, time.monotonic() + patience_s)
        yield
    finally:
        fcntl.flock(descriptor, fcntl.LOCK_UN)  # a fork of ours that hangs has it open too
        os.close(descriptor)


def _give_to_owner(descriptor: int, path: Path) -> None:
    """An administrator who edits the box's file must not lock the box out of it."""
    owner = (path if path.exists() else path.parent).stat()
    if (owner.st_uid, owner.st_gid) != (os.geteuid(), os.getegid()) and (os.geteuid() == 0 or path.exists()):
        os.fchown(descriptor, owner.st_uid, owner.st_gid)


def _lock(descriptor: int, until: float) -> None:
    while True:
        try:
            return fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= until:
                raise
            time.sleep(_LOCK_RETRY_S)
