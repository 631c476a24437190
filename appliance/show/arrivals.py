"""What lies on the stick and on the boot partition: listed in a moment, so that nothing new costs nothing."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Any, NamedTuple

SHOW, BOX = "show", "box.yaml"
_MOST_FILES = 4000
_DEEPEST = 8


class Arrival(NamedTuple):
    """A show bundle, a box file, or both. listing: names, sizes and times of all files; [] without any."""

    source: str  # stick, boot
    folder: Path
    listing: list[list[Any]]

    @property
    def show(self) -> Path | None:
        """The show bundle's folder."""
        return self.folder / SHOW if any(name.startswith(f"{SHOW}/") for name, *_ in self.listing) else None

    @property
    def box(self) -> Path | None:
        """The box file."""
        return self.folder / BOX if any(name == BOX for name, *_ in self.listing) else None

    @property
    def words(self) -> str:
        """What people call it."""
        return "the stick" if self.source == "stick" else "the boot partition"


def look(source: str, folder: Path) -> Arrival:
    """What lies in the folder `bunraku` of a stick or the boot partition; nothing where it cannot be read."""
    listing: list[list[Any]] = []
    try:
        box = (folder / BOX).lstat()
        if stat.S_ISREG(box.st_mode):
            listing.append([BOX, box.st_size, box.st_mtime_ns])
    except OSError:
        pass
    try:
        _list(folder / SHOW, f"{SHOW}/", listing, _DEEPEST)
    except OSError:
        listing.append([f"{SHOW}/?", 0, 0])  # it is there, and what reads it says why it cannot be read
    return Arrival(source, folder, sorted(listing))


def _list(folder: Path, prefix: str, listing: list[list[Any]], deeper: int) -> None:
    """Regular files alone: a link could lead anywhere, and hidden files are the file manager's."""
    try:
        entries = list(os.scandir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return
    for entry in entries:
        if entry.name.startswith(".") or len(listing) >= _MOST_FILES:
            continue
        if entry.is_dir(follow_symlinks=False) and deeper:
            _list(Path(entry.path), f"{prefix}{entry.name}/", listing, deeper - 1)
        elif entry.is_file(follow_symlinks=False):
            found = entry.stat(follow_symlinks=False)
            listing.append([prefix + entry.name, found.st_size, found.st_mtime_ns])
