"""A stage that shares frames and takes orders as the real one does, and show control in a thread."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from pythonosc.osc_message import OscMessage

from appliance.box.notify import Notifier
from appliance.box.orders import Order, OrderInbox
from appliance.box.show_state import ShowStateReader
from appliance.levers.addresses import Receiver
from appliance.levers.status import STATUS, Status
from appliance.outputs.puppet_facts import HandFacts, PuppetFacts
from appliance.outputs.shared_frame import Facts, FrameWriter
from appliance.show_control.packet import datagram
from appliance.show_control.port import open_port
from appliance.show_control.run import ControlProcess
from appliance.show_control.settings import ControlSettings
from tests.bundles import FIGURE
from tests.logged import said
from tests.outputs.small_stage import one_puppet

HOST = "127.0.0.1"
OF_PUPPET = {"coding", "interaction", "phrase", "base", "made", "position_s", "let_go"}
PATIENCE_S = 60.0
CUES: tuple[dict[str, Any], ...] = (
    {"name": "1", "look": "lines", "lights": None, "master": None, "fade_s": 0.0},
    {
        "name": "storm",
        "look": "ink",
        "card": "blank",
        "camera": {"angle_deg": 30.0, "figure": None},
        "lights": "cold",
        "master": 0.5,
        "fade_s": 4.0,
        "phrase": "quiet",
        "iterations": [12, 11],
        "liveliness": 0.25,
        "seed": 7,
        "hands": [],
    },
)


def facts(**changes: Any) -> Facts:
    """A show with two phrases, two cues, four looks, two sets of light mappings."""
    values: dict[str, Any] = {
        "show_directory": Path("show"),
        "box_file": None,
        "show_name": "A test",
        "skeleton": FIGURE,
        "puppets": (PuppetFacts(hands=(HandFacts(FIGURE.names[2], "left-wrist"),)),),
        "phrases": ("main", "quiet"),
        "cues": CUES,
        "looks": ("plaster", "lines", "ink", "cloud"),
        "cards": ("blank",),
        "lights": ("warm", "cold"),
        "coding": 3,
        "interaction": 2,
        "most_iterations": 8,
        "pid": os.getpid(),
        "started": time.monotonic(),
    }
    return Facts(**values | changes)


class Clock:
    """Stands at `now` until a test moves it."""

    def __init__(self, now: float = 1000.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


class StageDouble:
    """A context. `dances`: whether frames come; `obeys`: whether it takes orders and follows the show state;
    `answer`: what it makes of an order; `remark`: what it says about a change; `orders`: those that it took.
    """

    def __init__(self, folder: Path, show: Facts | None = None) -> None:
        self.dances = True
        self.obeys = True
        self.answer: Callable[[Order], tuple[bool, str]] = lambda order: (True, f"{order.name} it is.")
        self.orders: list[Order] = []
        self.reported: dict[str, Any] = {"state": "dancing", "rate_hz": 50.0, "puppets": [{"is_led": True}]}
        self.remark = ""
        self._show_state = ShowStateReader(folder)
        self._telling = threading.Lock()
        show = show or facts()
        self._writer = FrameWriter(folder, show)
        self._inbox = OrderInbox(folder, "stage")
        self._frame, self._skeleton = one_puppet(len(show.skeleton)), show.skeleton
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)

    def __enter__(self) -> StageDouble:
        self.tell()
        self._share()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()
        self._inbox.close()
        self._writer.close()
        self._show_state.close()

    def tell(self, **health: Any) -> None:
        """Say this about itself and its puppet from now on."""
        with self._telling:
            of_puppet = {name: health.pop(name) for name in OF_PUPPET & health.keys()}
            self.reported["puppets"] = [self.reported["puppets"][0] | of_puppet]
            self.reported |= health
            self._writer.write_health(self.reported)

    def hold(self, joint: str) -> None:
        """This joint is held from the next frame on."""
        self._frame.puppets[0].holds[self._skeleton.index(joint)] = 1.0

    def _live(self) -> None:
        while not self._is_over.wait(0.005):
            if self.dances:
                self._share()
            generation = self._show_state.read().generation
            if self.obeys and generation != self.reported.get("applied", [0])[0]:
                self.tell(applied=[generation, self.remark])
            while self.obeys and (order := self._inbox.take()) is not None:
                self.orders.append(order)
                self._inbox.answer(order, *self.answer(order))

    def _share(self) -> None:
        self._frame.tick += 1
        self._frame.frame_time = time.monotonic()
        self._writer.write(self._frame)


class InboxDouble:
    """Takes orders of another place and answers them, in a thread."""

    def __init__(self, folder: Path, place: Receiver) -> None:
        self.orders: list[Order] = []
        self._inbox = OrderInbox(folder, place)
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()

    def hold(self, joint: str) -> None:
        """This joint is held from the next frame on."""
        self._frame.puppets[0].holds[self._skeleton.index(joint)] = 1.0

    def _live(self) -> None:
        while not self._is_over.wait(0.005):
            while (order := self._inbox.take()) is not None:
                self.orders.append(order)
                self._inbox.answer(order, True, f"{order.name} it is.")

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        self._inbox.close()


class ControlInThread:
    """Show control, the real one, on a free port."""

    def __init__(
        self,
        folder: Path,
        key_file: Path | None = None,
        host: str = HOST,
        senders: Sequence[str] = (),
        heartbeat: Sequence[tuple[str, int]] = (),
        replies: Sequence[tuple[str, int]] = (),
        feedback: Sequence[tuple[str, int]] = (),
    ) -> None:
        self.said = said
        bound = open_port(host, 0)
        settings = ControlSettings(
            *(str(folder), bound.detach(), tuple(senders), tuple(heartbeat), str(key_file or "")),
            *(tuple(replies), tuple(feedback)),
        )
        self.process = ControlProcess(settings)
        self.port = self.process.port.number
        self._is_over = threading.Event()
        self._reading, self._writing = socket.socketpair()
        ended, wake = self._is_over.is_set, self._reading.fileno()
        self._thread = threading.Thread(
            target=self.process.run, args=(ended, wake, Notifier({})), daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        self._is_over.set()
        self._writing.send(b"!")
        self._thread.join()
        self.process.close()
        self._reading.close()
        self._writing.close()


class Asker:
    """A desk that sends commands and hears what comes back."""

    def __init__(self, port: int, host: str = HOST) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((host, port))

    def tell(self, address: str, *arguments: Any) -> None:
        self.socket.send(datagram((address, *arguments)))

    def hear(self, within_s: float = PATIENCE_S) -> list[Any] | None:
        """The next message, address first; None when none came."""
        if not select.select([self.socket], [], [], within_s)[0]:
            return None
        message = OscMessage(self.socket.recv(65536))
        return [message.address, *message.params]

    def ask(self, address: str, *arguments: Any) -> list[Any]:
        """Send one command and give what comes back first."""
        self.tell(address, *arguments)
        heard = self.hear()
        assert heard is not None, f"nothing came back for {address}"
        return heard

    def status(self) -> Status:
        """The answer to /status."""
        *fields, _ = self.ask_all("/status")
        return Status(**{address.removeprefix(f"{STATUS}/"): value for address, value in fields})

    def order(self, address: str, *arguments: Any) -> list[Any]:
        """Like `ask`, for what stage or projector carry out: again while these were held up for too long.

        Each try from a socket of its own, so that what comes late to one is not taken for another's reply.
        """
        ends_at = time.monotonic() + PATIENCE_S
        host, port = self.socket.getpeername()
        while True:
            with contextlib.closing(Asker(port, host)) as once:
                heard = once.ask(address, *arguments)
            if "not answer" not in str(heard[-1]) or time.monotonic() > ends_at:
                return heard

    def ask_all(self, address: str, *arguments: Any) -> list[list[Any]]:
        """Send a question and give all answers up to the one that ends them."""
        heard = [self.ask(address, *arguments)]
        while not heard[-1][0].endswith(("/end", "/reply")):
            following = self.hear()
            assert following is not None, heard
            heard.append(following)
        return heard

    def close(self) -> None:
        self.socket.close()


@contextlib.contextmanager
def control_process(folder: Path, output: Path) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Show control as the process that a box runs, and its port."""
    bound = open_port(HOST, 0)
    os.set_inheritable(bound.fileno(), True)
    settings = ControlSettings(str(folder), bound.fileno())
    with output.open("wb") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "appliance.show_control", settings.packed()],
            pass_fds=[bound.fileno()],
            stdout=out,
            stderr=subprocess.STDOUT,
        )
    try:
        yield process, bound.getsockname()[1]
    finally:
        bound.close()
        process.kill()
        process.wait()


def until(is_so: Callable[[], bool]) -> None:
    """Wait for it; fails after PATIENCE_S."""
    ends_at = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < ends_at, "it never came to that"
        time.sleep(0.005)
