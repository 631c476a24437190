"""A rig that hangs over the real box: an Art-Net node that takes its levels, and the lights' process."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from hw_sim.dmx.artnet import ArtNetReceiver
from hw_sim.peers import HOST
from tests.system.processes import PATIENCE_S, Process

PAN, DIMMER, PAR, SAFE = 0, 4, 20, 0.2
RIG = {
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
    """An Art-Net node: the newest levels of a universe, and all that came."""

    def __init__(self, receiver: ArtNetReceiver) -> None:
        self._receiver = receiver
        self.levels: dict[int, bytes] = {}
        self.arrivals: list[tuple[float, int, bytes]] = []

    def look(self) -> None:
        for arrival, packet in self._receiver.poll(0.05):
            self.levels[packet.port_address] = packet.levels
            self.arrivals.append((arrival, packet.port_address, packet.levels))

    def await_levels(self, is_wanted: Callable[[bytes], bool], universe: int = 1) -> None:
        until = time.monotonic() + PATIENCE_S
        while not (universe in self.levels and is_wanted(self.levels[universe])):
            assert time.monotonic() < until, self.levels.get(universe, b"nothing")[:32]
            self.look()

    def await_dance(self) -> None:
        """Fully lit, by a first mapping that says so."""
        self.await_levels(lambda levels: levels[DIMMER] == 255 and levels[PAR] == 255)

    def await_safe(self) -> None:
        self.await_levels(lambda levels: levels[DIMMER] == 0 and levels[PAR] == round(255 * SAFE))


@contextlib.contextmanager
def node() -> Iterator[tuple[Node, int]]:
    with ArtNetReceiver(HOST) as receiver:
        yield Node(receiver), receiver.port


class LightsProcess(Process):
    """`bunraku lights`."""

    def __init__(self, folder: Path, terminal: int | None = None) -> None:
        super().__init__(
            folder / "lights.txt", "lights", "--box", str(folder / "box.yaml"), terminal=terminal
        )
