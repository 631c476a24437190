"""A rig for the real box: an Art-Net node that receives its levels, and the lights' process."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from hw_sim.dmx.artnet import ArtNetReceiver
from hw_sim.peers import HOST
from tests.bundles import write_show
from tests.system.box import PLAY, Box, playing
from tests.system.processes import BUNRAKU, Process, wait_until

PAN, DIMMER, PAR, SAFE = 0, 4, 20, 0.2
RIG: dict[str, Any] = {
    "fixtures": [
        {"name": "head", "profile": "moving-wash", "address": 1, "place": [1.5, 3.5, 1.0]},
        {"name": "par", "profile": "led-par", "address": 21, "place": [-2, 3.5, 0]},
        {"name": "second", "profile": "led-par", "universe": 2, "address": 1},
    ],
    "mappings": [
        {
            "name": "warm",
            "rules": [
                {"reads": "place", "joint": "lForeArm", "drives": "aim"},
                {"reads": "steady", "drives": "dimmer"},
            ],
        },
        {"name": "dim", "rules": [{"reads": "steady", "drives": "dimmer", "value": 0.25}]},
    ],
    "safe": {"dimmer": SAFE, "fixtures": ["par"]},
}


class Node:
    """An Art-Net node: the newest levels of each universe, and everything that arrived."""

    def __init__(self, receiver: ArtNetReceiver) -> None:
        self._receiver = receiver
        self._came: deque[tuple[float, int, bytes]] = deque()
        self.levels: dict[int, bytes] = {}
        self.arrivals: list[tuple[float, int, bytes]] = []

    def receive(self) -> None:
        """Take what has arrived."""
        self._poll()
        while self._came:
            self._take_one()

    def _poll(self) -> None:
        polled = self._receiver.poll(0.05)
        self._came.extend((arrival, one.port_address, one.levels) for arrival, one in polled)

    def _take_one(self) -> None:
        if not self._came:
            self._poll()
        if self._came:
            self.arrivals.append(self._came.popleft())
            _, universe, self.levels[universe] = self.arrivals[-1]

    def await_levels(self, is_wanted: Callable[[bytes], bool], universe: int = 1) -> None:
        """Wait until levels come that are as wanted; the next wait goes on after them, however many came."""
        wait_until(
            lambda: universe in self.levels and is_wanted(self.levels[universe]),
            lambda: f"universe {universe} has {self.levels.get(universe, b'')[:32].hex() or 'nothing'}",
            self._take_one,
        )

    def await_dance(self) -> None:
        """Fully lit, as the first mapping has it."""
        self.await_levels(lambda levels: levels[DIMMER] == 255 and levels[PAR] == 255)

    def await_safe(self) -> None:
        self.await_levels(lambda levels: levels[DIMMER] == 0 and levels[PAR] == round(255 * SAFE))


def artnet(port: int, *universes: int) -> dict[str, Any]:
    """Settings of a box that sends these universes to a node on this port."""
    wires = [{"universe": one, "wire": "artnet", "host": HOST, "port": port} for one in universes]
    return {"outputs": {"dmx": wires}}


@contextlib.contextmanager
def node() -> Iterator[tuple[Node, int]]:
    with ArtNetReceiver(HOST) as receiver:
        yield Node(receiver), receiver.port


@contextlib.contextmanager
def lit_box(
    folder: Path, rig: dict[str, Any], *universes: int, command: Sequence[str] = PLAY
) -> Iterator[tuple[Node, Box]]:
    """A box with this rig, its universes (1 and 2) on a node."""
    show = write_show(folder / "show", lights=rig)
    with node() as (lamp, port):
        settings = artnet(port, *(universes or (1, 2)))
        with playing(show, folder, settings=settings, command=command) as box:
            yield lamp, box


class LightsProcess(Process):
    """`bunraku lights`."""

    def __init__(self, folder: Path, terminal: int | None = None) -> None:
        command = [*BUNRAKU, "lights", "--box", folder / "box.yaml"]
        super().__init__(folder / "lights.txt", command, terminal)
