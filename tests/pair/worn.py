"""An emulated wearable in the hall: as the firmware does, it streams to the box whose assignment it has."""

from __future__ import annotations

import math
import socket
import threading
import time
from contextlib import closing
from typing import Self

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from hw_sim.device import Lane
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator
from hw_sim.motions import dance
from hw_sim.network import PERFECT, VenueNetwork
from hw_sim.wearer import Wearer
from tests.pair.hall import FIRST, SECOND, Hall

_KIND = 3  # where a packet has its kind
_HELLO, _ASSIGNMENT, _CALL = (
    next(kind for kind, layout in wire.LAYOUTS.items() if layout.name == name)
    for name in ("Hello", "Assignment", "Call")
)


class HallRadio:
    """Greets both boxes, and speaks to the one that answered or called last."""

    def __init__(self, hall: Hall, port: int = 9750) -> None:
        with hall.hall.entered():
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._everyone = [(FIRST, port), (SECOND, port)]
        self._to = self._everyone

    @property
    def is_up(self) -> bool:
        return True

    @property
    def descriptor(self) -> int:
        return self._socket.fileno()

    def send_packet(self, data: bytes) -> bool:
        for address in self._everyone if data[_KIND] == _HELLO else self._to:
            self._socket.sendto(data, address)
        return True

    def receive_packet(self) -> bytes | None:
        try:
            data, sender = self._socket.recvfrom(2 * wire.LARGEST)
        except OSError:
            return None
        if data[_KIND] in (_ASSIGNMENT, _CALL):
            self._to = [sender]
        return data

    def close(self) -> None:
        self._socket.close()


class WornInHall:
    """A context: one wearable, worn by a dancer who moves."""

    def __init__(self, hall: Hall, key: SensorKey) -> None:
        self._wearer = Wearer(dance(0), math.inf)
        lanes = {Lane.NETWORK: HallRadio(hall)}
        self._emulator = Emulator(
            [EmulatedSensor(key, self._wearer)], [lanes], network=VenueNetwork(PERFECT, 1)
        )
        self._ended, self._moves = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def dance(self) -> None:
        """From now on it moves."""
        self._moves.set()

    def _run(self) -> None:
        with closing(self._emulator):
            self._emulator.run(None, self._ended.is_set, self._begin)

    def _begin(self) -> None:
        if self._moves.is_set():
            self._moves.clear()
            self._wearer.start_moving(time.monotonic())
