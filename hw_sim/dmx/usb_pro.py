"""An ENTTEC DMX USB Pro on a pseudo-terminal: it can be pulled out, plugged in, talk nonsense and hang."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import threading
import time
import tty
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import Self

from hw_sim.dmx.widget_message import Deframer, framed

GET_PARAMETERS, SEND_DMX, GET_SERIAL = 3, 6, 10  # labels of the DMX USB Pro API 1.44
PARAMETERS = bytes((44, 1, 9, 1, 40))  # firmware 1.44, break 96 us, mark 10.67 us, 40 Hz
LEAST, MOST = 25, 513  # octets of a universe with its start code; it sends no others
LOOKS_EACH_S = 0.02
REMEMBERED = 4096  # some 100 s


class UsbProWidget:
    """`path` is the device; it is there only while the widget is plugged in.

    universes: the newest ones that came in, each with its arrival (monotonic seconds), start code included.
    """

    def __init__(self, path: Path, serial_number: int = 0x01234567) -> None:
        self.path = path
        self.serial_number = serial_number
        self.universes: deque[tuple[float, bytes]] = deque(maxlen=REMEMBERED)
        self.labels: list[int] = []  # label of every whole message that came in
        self.broken = 0  # messages that did not end as they should
        self._master = self._slave = -1
        self._stop = threading.Event()
        self._hangs = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def levels(self) -> bytes | None:
        """Its DMX output: 512 levels or fewer; None before the first."""
        return self.universes[-1][1][1:] if self.universes else None

    def plug_in(self) -> None:
        """The device appears, readable for all users."""
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        Path(os.ttyname(self._slave)).chmod(0o666)
        self._stop.clear()
        self._thread = threading.Thread(target=self._serve, args=(self._master,), daemon=True)
        self._thread.start()
        self.path.symlink_to(os.ttyname(self._slave))

    def pull_out(self) -> None:
        """The device disappears, even while open; data in transit is lost."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self.path.unlink(missing_ok=True)
        for descriptor in (self._slave, self._master):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    def hang(self, hangs: bool = True) -> None:
        """Take nothing more in, until told otherwise; the line fills up."""
        (self._hangs.set if hangs else self._hangs.clear)()

    def send_message(self, garbage: bytes) -> None:
        """Send this to the program that has the device open, as a widget with a loose cable does."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, garbage)

    def __enter__(self) -> Self:
        self.plug_in()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.pull_out()

    def _serve(self, master: int) -> None:
        messages = Deframer()
        while not self._stop.is_set():
            if self._hangs.is_set():
                self._stop.wait(LOOKS_EACH_S)
                continue
            ready, _, _ = select.select([master], [], [], LOOKS_EACH_S)
            if not ready:
                continue
            received = os.read(master, 4096)
            arrival = time.monotonic()
            for label, payload in messages.feed(received):
                self._obey(master, label, payload, arrival)
            self.broken = messages.broken

    def _obey(self, master: int, label: int, payload: bytes, arrival: float) -> None:
        self.labels.append(label)
        if label == SEND_DMX and LEAST <= len(payload) <= MOST:
            self.universes.append((arrival, payload))
        elif label == GET_PARAMETERS:
            self._answer(master, label, PARAMETERS)
        elif label == GET_SERIAL:
            # Four octets of binary-coded decimal, the lowest first.
            self._answer(master, label, self.serial_number.to_bytes(4, "little"))

    @staticmethod
    def _answer(master: int, label: int, payload: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(master, framed(label, payload))
