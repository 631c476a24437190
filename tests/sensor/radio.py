"""A wearable at a real socket, and the socket of the link that it reaches."""

from __future__ import annotations

import socket
import time

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink
from appliance.sensor.transports.udp import UdpIntake
from tests.sensor.peers import KEYS, Wearable


class Radio:
    """A wearable at a socket."""

    def __init__(self, address: tuple[str, int], key: SensorKey = KEYS["left-wrist"]) -> None:
        self.wearable = Wearable(key)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(address)
        self.socket.setblocking(False)

    def move(self) -> None:
        """The same sensor at another address."""
        box = self.socket.getpeername()
        self.socket.close()
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(box)
        self.socket.setblocking(False)

    def hear(self) -> list[wire.Packet]:
        heard = []
        while True:
            try:
                heard.append(self.wearable.hear(self.socket.recv(200)))
            except BlockingIOError:
                return heard

    def pair(self, link: SensorLink) -> None:
        """Hello, assignment, first reading; on loopback what was sent has come."""
        self.socket.send(self.wearable.hello())
        link.drain(time.monotonic())
        link.send_due(time.monotonic())
        assert self.hear()
        self.socket.send(self.wearable.reading())
        assert [reading.sequence for reading in link.drain(time.monotonic())] == [self.wearable.sequence]
        link.send_due(time.monotonic())


def intake_of(link: SensorLink) -> UdpIntake:
    intake = link.intakes[0]
    assert isinstance(intake, UdpIntake)
    return intake
