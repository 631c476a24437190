"""Where the projector leaves a picture of the wall, how old it may be, and how the page asks for more."""

from __future__ import annotations

import contextlib
from pathlib import Path

WALL = "wall.jpg"  # in the runtime folder, in memory
EVERY_S = 10.0
ASKED = "wall.asked"  # a page on a screen touches it at each look at the wall
SOON_S = 2.0  # then
LARGEST = 200_000  # bytes


def wall_picture(folder: Path, now: float) -> bytes:
    """The newest JPEG of the wall; b"": no projector shows one. now: Unix seconds."""
    try:
        with (folder / WALL).open("rb") as file:
            content = file.read(LARGEST + 1)
            written = (folder / WALL).stat().st_mtime
    except OSError:
        return b""
    return content if len(content) <= LARGEST and abs(now - written) <= 3 * EVERY_S else b""


def ask_for_wall(folder: Path) -> None:
    """For the next ten seconds pictures come every two."""
    with contextlib.suppress(OSError):
        (folder / ASKED).touch()


def is_wall_asked_for(folder: Path, now: float) -> bool:
    """Whether a browser shows the wall. now: Unix seconds."""
    try:
        return abs(now - (folder / ASKED).stat().st_mtime) <= EVERY_S
    except OSError:
        return False
