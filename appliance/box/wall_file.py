"""Where the projector leaves a picture of the wall, and how old it may be: the page reads it."""

from __future__ import annotations

from pathlib import Path

WALL = "wall.jpg"  # in the runtime folder, in memory
EVERY_S = 10.0
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
