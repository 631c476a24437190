"""Emulated wearables for the real box, in a thread: dancing, switched off, out of reach, on a cable."""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

from appliance.sensor.keys import SensorKey
from hw_sim.device import Lane
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator, Sender, Sent
from hw_sim.motions import Motion, dance
from hw_sim.network import VENUE, VenueNetwork
from hw_sim.senders import SerialSender, UdpSender
from hw_sim.wearer import Wearer

HOST = "127.0.0.1"


class Radio(UdpSender):
    """A network lane that can lose both directions at once; the sensor does not notice."""

    in_reach = True

    def send_packet(self, data: bytes) -> bool:
        return super().send_packet(data) if self.in_reach else True

    def receive_packet(self) -> bytes | None:
        while (data := super().receive_packet()) is not None and not self.in_reach:
            pass
        return data


class Wearables:
    """A context: the sensors run inside it, on a venue's network.

    Their wearers stand still until `dance`, so the box takes the neutral pose however often readings pause.
    """

    def __init__(
        self,
        keys: Sequence[SensorKey],
        port: int | None = None,
        *,
        radio: Callable[[], Sender] | None = None,
        cable: Path | None = None,
        motion: Callable[[int], Motion] = dance,
        on_sent: Callable[[Sent], None] | None = None,
    ) -> None:
        """port: of a box on this machine; radio: makes each sensor's lane to another place."""
        self._wearers = [Wearer(motion(number), math.inf) for number in range(len(keys))]
        self.sensors = [EmulatedSensor(key, wearer) for key, wearer in zip(keys, self._wearers, strict=True)]
        self.radios = [] if port is None else [Radio(HOST, port) for _ in keys]
        lanes = self.radios if radio is None else [radio() for _ in keys]
        senders: list[dict[Lane, Sender]] = [{Lane.NETWORK: lane} for lane in lanes]
        if cable is not None:
            senders[0][Lane.CABLE] = SerialSender(str(cable))
        self.emulator = Emulator(self.sensors, senders, network=VenueNetwork(VENUE, 1), on_sent=on_sent)
        self._requests: queue.SimpleQueue[Callable[[float], None]] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Wearables:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def dance(self) -> None:
        """Make all wearers move from now on."""
        for wearer in self._wearers:
            self.do(wearer.start_moving)

    def do(self, request: Callable[[float], None]) -> None:
        """Call `request` in the sensors' own thread, with the current time."""
        self._requests.put(request)

    def _run(self) -> None:
        with closing(self.emulator):
            self.emulator.run(None, self._ended.is_set, self._fulfil)

    def _fulfil(self) -> None:
        while not self._requests.empty():
            self._requests.get()(time.monotonic())
