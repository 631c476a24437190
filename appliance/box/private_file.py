"""A file for its owner alone (mode 0600) that is replaced as a whole or not at all, even in a power cut."""

from __future__ import annotations

import os
from pathlib import Path

from appliance.box.durable import sync_folder

OWNER_ONLY = 0o600


def replace_private(path: Path, text: str) -> None:
    """Put `text` in the place of what `path` holds. Raises OSError, and then `path` is as it was."""
    put_in_place(write_beside(path, text), path)


def write_beside(path: Path, text: str) -> Path:
    """Write `text` to the disk beside `path`, ready to take its place; what an earlier try left gives way."""
    beside = path.with_name(f".{path.name}.new")
    beside.unlink(missing_ok=True)
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            os.fchmod(file.fileno(), OWNER_ONLY)  # whatever the umask
            _give_to_owner(file.fileno(), path)
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        beside.unlink(missing_ok=True)
        raise
    return beside


def put_in_place(beside: Path, path: Path) -> None:
    """Let the file beside `path` take its place, at once and for good."""
    beside.replace(path)
    sync_folder(path.parent)


def _give_to_owner(descriptor: int, path: Path) -> None:
    """An administrator who edits the box's file must not lock the box out of it."""
    owner = (path if path.exists() else path.parent).stat()
    if (owner.st_uid, owner.st_gid) != (os.geteuid(), os.getegid()) and (os.geteuid() == 0 or path.exists()):
        os.fchown(descriptor, owner.st_uid, owner.st_gid)
