"""The wall as it is now, for the page: a small picture every ten seconds, or every two if it asks."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from appliance.box.wall_file import EVERY_S, SOON_S, WALL, is_wall_asked_for

WIDTH = 480  # pixels at least, where the wall has as many; less than twice as many
_QUALITY = 70  # JPEG quality: 8 to 25 kB a picture
_LAST_S = 1.0


class SeenWall:
    """Writes the picture from its own thread: a picture costs the projector one read of the screen."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._path = folder, folder / WALL
        self._soon_at = self._next_at = 0.0
        self._writing: threading.Thread | None = None

    def offer(self, now: float, size: tuple[int, int], read: Callable[[], bytes]) -> None:
        """Take this picture, if it is time to. read: its RGBA bytes, bottom row first."""
        if now < self._soon_at or (self._writing is not None and self._writing.is_alive()):
            return
        self._soon_at = now + SOON_S
        if now < self._next_at and not is_wall_asked_for(self._folder, time.time()):
            return
        self._next_at = now + EVERY_S
        self._writing = threading.Thread(target=self._write, args=(read(), size), daemon=True)
        self._writing.start()

    def close(self) -> None:
        """No wall is seen any more."""
        if self._writing is not None:
            self._writing.join(_LAST_S)
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)

    def _write(self, pixels: bytes, size: tuple[int, int]) -> None:
        whole = Image.frombuffer("RGBA", size, pixels, "raw", "RGBA", 0, -1).convert("RGB")
        beside = self._path.with_suffix(".part")
        with contextlib.suppress(OSError):  # the folder is gone, or full: the next one comes
            whole.reduce(max(1, size[0] // WIDTH)).save(beside, "JPEG", quality=_QUALITY)
            beside.replace(self._path)
