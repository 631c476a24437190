"""The contents of the stick and the boot partition, listed so quickly that checking costs nothing."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

SHOW, BOX = "show", "box.yaml"
_LABELS = {
    **{name: f"the {name}" for name in ("stick", "page", "rehearsal", "learning")},
    "fleet": "another box",
}
_MOST_ENTRIES = 4000  # files, folders and everything else: on a damaged stick a folder may contain itself
_UNREADABLE = [f"{SHOW}/?", 0, 0]  # it is there, and what reads it says that it cannot be read


class Arrival(NamedTuple):
    """A show bundle, a box file, or both. listing: names, sizes and times of all files; [] without any."""

    source: str  # stick, boot, page, rehearsal, learning, fleet
    folder: Path
    listing: list[list[Any]]

    @property
    def show(self) -> Path | None:
        """The show bundle's folder."""
        return self.folder / SHOW if any(name.startswith(f"{SHOW}/") for name, *_ in self.listing) else None

    @property
    def box(self) -> Path | None:
        return self.folder / BOX if any(name == BOX for name, *_ in self.listing) else None

    @property
    def parts(self) -> frozenset[str]:
        """The shows and box files that it brings."""
        return frozenset(name.partition("/")[0] for name, *_ in self.listing)

    def without(self, parts: frozenset[str]) -> Arrival:
        """Its other contents."""
        listing = [one for one in self.listing if one[0].partition("/")[0] not in parts]
        return self._replace(listing=listing)

    @property
    def label(self) -> str:
        """Its name for people."""
        return _LABELS.get(self.source, "the boot partition")


def look(source: str, folder: Path) -> Arrival:
    """The contents of the folder `bunraku` of a stick or the boot partition; nothing if it cannot be read."""
    listing: list[list[Any]] = []
    try:
        box = (folder / BOX).lstat()
        if stat.S_ISREG(box.st_mode):
            listing.append([BOX, box.st_size, box.st_mtime_ns])
    except OSError:
        pass
    try:
        listing += _files(folder / SHOW)
    except FileNotFoundError:
        pass
    except OSError:
        listing.append(_UNREADABLE)
    return Arrival(source, folder, sorted(listing))


def _files(show: Path) -> Iterator[list[Any]]:
    """Only regular files: a link could lead anywhere, and hidden files are the file manager's."""
    folders = [(show, f"{SHOW}/")] if stat.S_ISDIR(show.lstat().st_mode) else []
    left = _MOST_ENTRIES
    while folders:
        folder, prefix = folders.pop()
        with os.scandir(folder) as entries:
            for entry in entries:
                left -= 1
                if left < 0:
                    yield _UNREADABLE
                    return
                if entry.name.startswith("."):
                    continue
                if entry.is_dir(follow_symlinks=False):
                    folders.append((Path(entry.path), f"{prefix}{entry.name}/"))
                elif entry.is_file(follow_symlinks=False):
                    found = entry.stat(follow_symlinks=False)
                    yield [prefix + entry.name, found.st_size, found.st_mtime_ns]
