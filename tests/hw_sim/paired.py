"""A sensor for other tests: it pairs with the box's own link over a real socket, on the test's own clock."""

from __future__ import annotations

from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink
from hw_sim.device import Lane, Sample
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.motions import Motion
from hw_sim.senders import UdpSender
from hw_sim.wearer import Wearer

TICK_S = 0.02
STARTS_WITHIN_TICKS = 60  # the IMU alone needs 35


class PairedSensor:
    """`now` is in seconds and moves with `advance`; a reading is due with each tick of 20 ms."""

    def __init__(self, key: SensorKey, port: int, motion: Motion, now: float) -> None:
        self.sensor = EmulatedSensor(key, Wearer(motion), phase_s=TICK_S / 2)
        self._sender = UdpSender("127.0.0.1", port)
        self.sensor.start(now)
        self.sensor.connect(Lane.NETWORK, True, now)

    def advance(self, now: float) -> list[Sample]:
        """Hears what the box has sent, then sends what is due; the readings among it."""
        while (data := self._sender.receive_packet()) is not None:
            self.sensor.receive_packet(data, now, Lane.NETWORK)
        left = self.sensor.step(now)
        for outgoing in left:
            assert self._sender.send_packet(outgoing.data)
        return [outgoing.sample for outgoing in left if outgoing.sample is not None]

    def pair(self, link: SensorLink, now: float) -> float:
        """Until its first readings are believed; the time then."""
        for tick in range(STARTS_WITHIN_TICKS):
            at = now + tick * TICK_S
            self.advance(at)
            believed = link.drain(at)
            link.send_due(at)
            if believed:
                return at
        raise AssertionError("the box does not take the sensor")

    def close(self) -> None:
        self._sender.close()
