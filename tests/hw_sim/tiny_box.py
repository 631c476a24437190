"""The box's side of pairing in a few lines, on the test's own clock: real packets, no sockets, no tick."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import count

from appliance.sensor import wire
from appliance.sensor.keys import SensorKey
from hw_sim import motions
from hw_sim.device import Lane
from hw_sim.emulated_sensor import EmulatedSensor
from hw_sim.emulator import Emulator, Sender, Sent
from hw_sim.network import VenueNetwork
from hw_sim.wearer import Wearer

KEY = SensorKey("left-wrist", 0x11, bytes(range(16)))
HEARTBEAT_S = 1.0


class TinyBox:
    """Answers hellos, beats once a second while it hears a sensor, and keeps what it heard.

    answers: whether it says anything at all. A new one is a box that was started anew.
    """

    def __init__(self, key: SensorKey = KEY, session: int = 0x5E55) -> None:
        self.key = key
        self.tagger = wire.Tagger(key.key)
        self.session = session
        self.answers = True
        self.led = wire.LED_ON
        self.rate_hz = 50
        self.heard: list[tuple[float, wire.Packet]] = []
        self.boot_nonce = 0
        self._sequence = count()
        self._next_beat = 0.0

    def of(self, kind: type[wire.Packet]) -> list[tuple[float, wire.Packet]]:
        return [(at, packet) for at, packet in self.heard if type(packet) is kind]

    def hear(self, data: bytes, now: float) -> list[bytes]:
        try:
            packet = wire.unpack(data, lambda device: self.tagger if device == self.key.device_id else None)
        except wire.WireError:
            return []
        self.heard.append((now, packet))
        if not self.answers:
            return []
        self.boot_nonce = packet.boot_nonce
        if isinstance(packet, wire.Hello):
            return [self.assignment(packet.sequence)]
        if isinstance(packet, wire.Reading) and packet.session != self.session:
            return [self.call()]
        return []

    def beat(self, now: float) -> list[bytes]:
        if not self.answers or not self.heard or now < self._next_beat:
            return []
        self._next_beat = now + HEARTBEAT_S
        readings = self.of(wire.Reading)
        at, newest = readings[-1] if readings else (now, self.heard[-1][1])
        return [self.sign(wire.Heartbeat(*self.head(), newest.sequence, round((now - at) * 1e6), self.led))]

    def assignment(self, hello: int, session: int | None = None) -> bytes:
        head = self.head(self.session if session is None else session)
        return self.sign(wire.Assignment(*head, hello, 0, self.rate_hz, self.led))

    def call(self) -> bytes:
        return self.sign(wire.Call(*self.head(0)))

    def head(self, session: int | None = None) -> tuple[int, int, int, int]:
        session = self.session if session is None else session
        return self.key.device_id, self.boot_nonce, session, next(self._sequence)

    def sign(self, packet: wire.Packet) -> bytes:
        return wire.pack(packet, self.tagger)


class Line:
    """A Sender that ends in a TinyBox instead of a socket; `passing_on` sees each datagram first."""

    descriptor = None

    def __init__(self, box: TinyBox, clock: Callable[[], float]) -> None:
        self.box = box
        self.is_up = True
        self.passing_on: Callable[[bytes], object] = lambda data: None
        self._clock = clock
        self._waiting: deque[bytes] = deque()

    def send_packet(self, data: bytes) -> bool:
        if not self.is_up:
            return False
        self.passing_on(data)
        self._waiting.extend(self.box.hear(data, self._clock()))
        return True

    def receive_packet(self) -> bytes | None:
        if not self.is_up:
            self._waiting.clear()
            return None
        if not self._waiting:
            self._waiting.extend(self.box.beat(self._clock()))
        return self._waiting.popleft() if self._waiting else None

    def inject(self, data: bytes) -> None:
        """A packet for the device from somebody."""
        self._waiting.append(data)

    def close(self) -> None: ...


class FakeClock:
    """A monotonic clock that sleeping moves on, always a little further than asked for."""

    def __init__(self, oversleep_s: float = 0.0001) -> None:
        self.now = 50.0
        self.oversleep_s = oversleep_s

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds + self.oversleep_s


class Pair:
    """An emulated sensor and a tiny box, in step on one clock that starts at 50."""

    def __init__(
        self,
        device: EmulatedSensor,
        box: TinyBox | None = None,
        *,
        clock: FakeClock | None = None,
        network: VenueNetwork | None = None,
        switched_on: bool = True,
    ) -> None:
        self.clock = clock or FakeClock()
        self.box = box or TinyBox()
        self.line = Line(self.box, self.clock)
        self.cable = Line(self.box, self.clock)
        self.cable.is_up = False
        self.sent: list[Sent] = []
        senders: dict[Lane, Sender] = {Lane.NETWORK: self.line, Lane.CABLE: self.cable}
        self.device = device
        self.emulator = Emulator(
            [device],
            [senders],
            network=network,
            on_sent=self.sent.append,
            clock=self.clock,
            sleep=self.clock.sleep,
        )
        if switched_on:
            self.emulator.start(self.clock.now)

    def run(self, seconds: float) -> None:
        end = self.clock.now + seconds
        while self.clock.now < end:
            due = min(self.emulator.step(self.clock.now), end, self.clock.now + 0.05)
            self.clock.sleep(max(due - self.clock.now, 0.0))


def paired(motion: motions.Motion | None = None, box: TinyBox | None = None, **options: object) -> Pair:
    sensor = EmulatedSensor(KEY, Wearer(motion or motions.still()), **options)  # type: ignore[arg-type]
    return Pair(sensor, box)


def hello_times(pair: Pair) -> list[float]:
    return [at for at, _ in pair.box.of(wire.Hello)]


def readings(pair: Pair) -> list[wire.Reading]:
    return [packet for _, packet in pair.box.of(wire.Reading) if isinstance(packet, wire.Reading)]
