"""A cable between two programs: two pseudo-terminals under fixed names, and a thread that joins them."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import threading
import tty
from pathlib import Path
from types import TracebackType

LOOKS_EACH_S = 0.05


class NullModem:
    """`near` and `far` are the two devices; they are there only while it is plugged in."""

    def __init__(self, folder: Path) -> None:
        self.near, self.far = folder / "ttyNear", folder / "ttyFar"
        self._masters: list[int] = []
        self._slaves: list[int] = []
        self._thread: threading.Thread | None = None

    def plug_in(self) -> None:
        for name in (self.near, self.far):
            master, slave = pty.openpty()
            tty.setraw(slave)
            os.set_blocking(master, False)
            self._masters.append(master)
            self._slaves.append(slave)
            name.symlink_to(os.ttyname(slave))
        self._thread = threading.Thread(target=self._pump, args=tuple(self._masters), daemon=True)
        self._thread.start()

    def pull_out(self) -> None:
        masters, self._masters = self._masters, []
        if self._thread is not None:
            self._thread.join()
        for name in (self.near, self.far):
            name.unlink(missing_ok=True)
        for descriptor in (*self._slaves, *masters):
            os.close(descriptor)
        self._slaves = []

    def __enter__(self) -> NullModem:
        self.plug_in()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._masters:
            self.pull_out()

    def _pump(self, near: int, far: int) -> None:
        while self._masters:
            ready, _, _ = select.select([near, far], [], [], LOOKS_EACH_S)
            for one in ready:
                with contextlib.suppress(BlockingIOError):  # a full line loses bytes, as a real one does
                    os.write(far if one == near else near, os.read(one, 4096))
