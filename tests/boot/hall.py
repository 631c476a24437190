"""The hall around the box: a network cable, an audience that watches, a dancer who wears a sensor."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from appliance.sensor.keys import create_keys
from hw_sim.osc_receiver import decode
from hw_sim.receive_buffer import widen
from tests.boot.pauses import Seen
from tests.system.namespace import Cable, Namespace

BOX, HALL = "10.77.0.1", "10.77.0.2"
SENSOR = "left-wrist"
SENSORS, CONTROL, FRAMES = 9750, 9002, 9004
_TIMESTAMPS = 35  # SO_TIMESTAMPNS
_BUFFER_BYTES = 64 << 20  # minutes of frames: the test need not read while the box is being killed


class Audience:
    """Receives the dance. The kernel says when each datagram came in, however late it is read."""

    def __init__(self, port: int = FRAMES) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        widen(self._socket, _BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, _TIMESTAMPS, 1)
        self._socket.bind((HALL, port))
        self._socket.setblocking(False)
        self._frame: tuple[float, list[Any]] | None = None
        self.frames: list[Seen] = []

    def watch(self, seconds: float = 0.0) -> list[Seen]:
        """All frames of the next seconds, and those that waited."""
        known, until = len(self.frames), time.monotonic() + seconds
        while True:
            left_s = until - time.monotonic()
            select.select([self._socket], [], [], max(0.0, left_s))
            self._read()
            if left_s <= 0:
                return self.frames[known:]

    def forget(self) -> None:
        """What came in so far."""
        self._read()
        self.frames.clear()

    def close(self) -> None:
        self._socket.close()

    def _read(self) -> None:
        while True:
            try:
                datagram, reported, _, _ = self._socket.recvmsg(65536, 64)
            except BlockingIOError:
                return
            for address, received in decode(datagram):
                arguments: list[Any] = list(received)
                if address == "/bunraku/frame":
                    seconds, nanoseconds = struct.unpack("qq", reported[0][2])
                    self._frame = seconds + 1e-9 * nanoseconds, arguments
                elif address.endswith("/joint/pos_world") and self._frame is not None:
                    at, (tick, _, sequence, late, _) = self._frame
                    x, _, z = arguments[:3]
                    self.frames.append(Seen(at, tick, sequence, bool(late), (float(x), float(z))))
                    self._frame = None


@dataclass
class Hall:
    """Everything outside of the box. `folder`: box file and keys."""

    folder: Path
    box_network: Namespace
    network: Namespace
    audience: Audience
    console: socket.socket
    key_file: bytes = b""
    sensor: subprocess.Popen[bytes] | None = None

    def ask(self, address: str, patience_s: float = 5.0) -> list[tuple[str, list[Any]]]:
        """What show control answers to a question without arguments."""
        self._forget_late_answers()
        padded = address.encode() + b"\0" * (4 - len(address) % 4)
        self.console.sendto(padded + b",\0\0\0", (BOX, CONTROL))
        return self.answers(
            lambda answers: any(where in ("/end", "/reply", "/pong") for where, _ in answers), patience_s
        )

    def answers(
        self, enough: Callable[[list[tuple[str, list[Any]]]], bool], patience_s: float
    ) -> list[tuple[str, list[Any]]]:
        """What came back until it is enough, or until patience ends."""
        found: list[tuple[str, list[Any]]] = []
        until = time.monotonic() + patience_s
        while not enough(found) and time.monotonic() < until:
            if select.select([self.console], [], [], 0.05)[0]:
                with contextlib.suppress(OSError):
                    found += decode(self.console.recv(65536))
        return found

    def _forget_late_answers(self) -> None:
        """Those of an earlier question, or of the box before."""
        while select.select([self.console], [], [], 0.0)[0]:
            with contextlib.suppress(OSError):
                self.console.recv(65536)

    def dance_with_sensor(self) -> None:
        """A dancer switches the wearable on; it moves until it is switched off or the hall closes."""
        self.switch_sensor_off()
        emulate = [sys.executable, "-m", "hw_sim", "emulate", "--sensor", SENSOR, "--motion", "dance"]
        emulate += ["--keys", str(self.folder / "sensors.keys"), "--host", BOX, "--port", str(SENSORS)]
        with (self.folder / "sensor.txt").open("ab") as output:
            self.sensor = subprocess.Popen(
                self.network.command(*emulate, "--network", "perfect", "--stand-still", "0"),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def switch_sensor_off(self) -> None:
        if self.sensor is not None:
            self.sensor.terminate()
            self.sensor.wait()
            self.sensor = None


@contextlib.contextmanager
def hall(folder: Path) -> Iterator[Hall]:
    """Two networks and a cable between them: the box at 10.77.0.1, all else at 10.77.0.2."""
    with contextlib.ExitStack() as opened:
        box = opened.enter_context(Namespace("box"))
        outside = opened.enter_context(Namespace("hall"))
        Cable(box, f"{BOX}/24", outside, f"{HALL}/24")
        with outside.entered():
            audience = opened.enter_context(contextlib.closing(Audience()))
            console = opened.enter_context(
                contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            )
            console.bind((HALL, 0))
        create_keys(folder / "sensors.keys", [SENSOR])
        made = Hall(folder, box, outside, audience, console, (folder / "sensors.keys").read_bytes())
        opened.callback(made.switch_sensor_off)
        yield made


def box_file(**own: Any) -> str:
    """The venue's box file: the dance, its heartbeat and its console are in the hall."""
    values: dict[str, Any] = {
        "sensors": {"udp": {"host": "0.0.0.0", "port": SENSORS}, "keys": "/data/bunraku/keys/sensors.keys"},
        "outputs": {
            "osc": [{"host": HALL, "port": FRAMES, "dialect": "ai-toolbox", "frame_message": True}],
            "dmx": [{"universe": 1, "wire": "artnet", "host": HALL}],
        },
        "control": {"host": "0.0.0.0", "port": CONTROL, "senders": [HALL]},
        "state": "/data/bunraku/state",
        **own,
    }
    return str(yaml.safe_dump(values))
