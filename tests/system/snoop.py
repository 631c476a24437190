"""Somebody else on this machine, who looks for secrets."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class Snoop:
    """Another user of this machine: looks at all command lines, environments and files, again and again."""

    def __init__(self, folder: Path) -> None:
        self.seen: set[bytes] = set()
        self.readable: set[tuple[str, int]] = set()
        self._folder = folder
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def _look(self) -> None:
        while not self._is_over.wait(0.002):
            for process in Path("/proc").glob("[0-9]*"):
                for name in ("cmdline", "environ"):
                    try:
                        self.seen.add((process / name).read_bytes())
                    except OSError:
                        continue
            for path in self._folder.rglob("*"):
                try:
                    self.readable.add((path.name, path.stat().st_mode & 0o777))
                except OSError:
                    continue

    @contextmanager
    def looking(self) -> Iterator[None]:
        self._thread.start()
        try:
            yield
        finally:
            self._is_over.set()
            self._thread.join()
