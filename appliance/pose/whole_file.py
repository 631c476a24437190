"""Files that are whole or as they were: written under a hidden name beside their own, then renamed."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # linux/fcntl.h, linux/fs.h


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """The file to write in place of `path`, beside it; its ending is the same, for libraries that go by it.

    At the end it is renamed, and both content and name are on the disk. After any error, and after Ctrl-C,
    `path` is as it was. Raises OSError.
    """
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    part.unlink(missing_ok=True)  # an earlier try left it
    try:
        yield part
        sync(part)  # else a power cut may leave the new name without the content
        part.replace(path)
        sync(path.parent)
    finally:
        part.unlink(missing_ok=True)


def write_text_whole(path: Path, text: str) -> None:
    """The same for a text, in UTF-8."""
    with written_whole(path) as part:
        part.write_text(text, encoding="utf-8")


def sync(path: Path) -> None:
    """The content of a file, or the names in a folder, are on the disk. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def exchange(one: Path, other: Path) -> None:
    """Each of two folders takes the other's name in one step. Raises OSError where the system has none."""
    import ctypes

    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, "renameat2"):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS), str(one))
    names = os.fsencode(one), os.fsencode(other)
    if libc.renameat2(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), str(one))
    with contextlib.suppress(OSError):  # it is done, though a power cut might undo it
        sync(other.parent)
