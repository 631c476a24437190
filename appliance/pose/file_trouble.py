"""An operating system error about a file or folder, as a sentence: what happened, and what to do."""

from __future__ import annotations

import contextlib
import difflib
import errno
import os
from pathlib import Path

_NO_ROOM = "Make room there or name another place, then give the command again."
_SENTENCES = {
    errno.EISDIR: "{} is a folder. Name a file.",
    errno.ENOTDIR: "{} cannot be there: a part of this path is a file, not a folder. Check the path.",
    errno.EEXIST: "{} exists already and is no folder. Name another place, or remove it.",
    errno.ENOTEMPTY: "{} is a folder that is not empty. Name another place, or empty it.",
    errno.EACCES: "{}: you may not read or write this. Check its owner and rights, or name another place.",
    errno.EPERM: "{}: no file may be written there. Name another place.",
    errno.EROFS: "{}: the disk is read-only. Name another place.",
    errno.ENOSPC: f"{{}}: the disk is full. {_NO_ROOM}",
    errno.EDQUOT: f"{{}}: your share of the disk is used up. {_NO_ROOM}",
    errno.EFBIG: "{}: the file is larger than is allowed here. Name another file or place.",
    errno.EINVAL: "{} is no regular file. Name a file.",
    errno.ENAMETOOLONG: "{}: the name is too long for this disk. Choose a shorter one.",
    errno.ELOOP: "{}: links lead in a circle. Name the file itself.",
    errno.EIO: "{}: the disk gives errors. Copy what you need from it, and use another one.",
    errno.EMFILE: "{}: too many files are open. Close other programs, then give the command again.",
}
_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EMFILE)


def sentence(error: OSError, path: Path | None = None) -> str | None:
    """A sentence about it; None where neither the error nor the caller names a file, and no disk failed.

    path: the file that was meant, where the error does not name one (a write to a full disk does not).
    """
    named = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else path
    if error.errno == errno.ENOENT and named is not None:
        return _absent(named)
    if named is None and error.errno not in _DISK:
        return None
    message = _SENTENCES.get(error.errno or 0, "{}: " + f"{error.strerror or error}. Check this file.")
    return message.format("A file could not be written" if named is None else named)


def _absent(path: Path) -> str:
    """A file that is not there: what is missing of its path, and what may have been meant."""
    if path.is_symlink():
        return f"{path} is a link to {path.readlink()}, which does not exist. Name the file itself."
    if not path.parent.is_dir():
        return f"{path} does not exist: there is no folder {path.parent}. Check the path."
    near: list[str] = []
    with contextlib.suppress(OSError):
        near = difflib.get_close_matches(path.name, [one.name for one in path.parent.iterdir()], n=1)
    cure = f"Did you mean '{near[0]}'?" if near else "Check its name and place."
    return f"{path} does not exist. {cure}"
