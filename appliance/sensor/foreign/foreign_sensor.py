"""A foreign sensor: speaks the wire to the stage as a wearable does, for a phone or a program."""

from __future__ import annotations

import contextlib
import math
import secrets
import socket
from collections import Counter
from dataclasses import dataclass, field

from appliance.sensor import wire
from appliance.sensor.foreign.door import LOOPBACK, Door, foreign_key
from appliance.sensor.state import Orientation

CLOSEST_S = 0.009  # between two readings: a source that is faster is thinned
HELLO_EVERY_S = 0.2
LOST_S = 3.0  # without a packet from the stage, as in the firmware
_ANSWERED_HELLOS = 4  # an assignment answers the newest hello or one of the three before
_LONGEST = 2 * wire.LARGEST
_UNIT = 0.1  # a quaternion this far from length 1 is refused
_LAMPS = {wire.LED_ON: "on", wire.LED_SLOW: "slow", wire.LED_FAST: "fast", wire.LED_STROBE: "strobe"}
_CALIBRATED = 0xFF
_NO_FIRMWARE = (0, 0, 0)


@dataclass
class _Boot:
    """A power-on: all that a wearable forgets when it is switched off. session: 0 while it has no link."""

    nonce: int = field(default_factory=lambda: secrets.randbits(32))
    session: int = 0
    readings: int = 0
    hellos: int = 0
    answered: int = -1
    led: int = wire.LED_OFF
    heard: float = -math.inf
    hello_at: float = -math.inf
    sent_at: float = -math.inf


class ForeignSensor:
    """Sends what it is given as signed readings, once the stage has let it in. Never waits, never raises.

    Time is an argument, monotonic seconds. `taps` counts double taps, each of which asks for a neutral pose.
    Counts: `invalid` orientations, and readings that were `thinned`.
    """

    def __init__(self, name: str, source: str, door: Door, drifts: bool = True) -> None:
        """drifts: whether its heading does; an optical tracker's does not, and is never corrected."""
        self.name, self.source = name, source
        self._flags = wire.HAS_PROFILE | (0 if drifts else wire.IS_NDOF)
        self.counts: Counter[str] = Counter()
        self.taps = 0
        self._door = door
        self._found: tuple[int, bytes] | None = None
        self._socket: socket.socket | None = None
        self._device_id, self._tagger = 0, wire.Tagger(bytes(wire.KEY_BYTES))
        self._boot = _Boot()
        self._battery = wire.BATTERY_UNKNOWN
        self._has_news = False

    @property
    def is_linked(self) -> bool:
        """Whether the stage hears it."""
        return self._boot.session != 0

    @property
    def lamp(self) -> str:
        """The state of a wearable's lamp: off, on, slow, fast, strobe, or looking (for the stage)."""
        return _LAMPS.get(self._boot.led, "off") if self.is_linked else "looking"

    def switch_on(self) -> None:
        """Count as switched on again: the source's heading is another one from here on."""
        self._boot = _Boot()

    def take(self, orientation: Orientation, now: float, battery: int = wire.BATTERY_UNKNOWN) -> bool:
        """Send an orientation (w, x, y, z; from the sensor's axes to a room with z up); whether it left."""
        length = math.hypot(*orientation)
        if not abs(length - 1.0) < _UNIT:
            self.counts["invalid"] += 1
            return False
        self._has_news, self._battery = True, battery
        self.turn(now)
        boot = self._boot
        if boot.session == 0:
            return False
        if now - boot.sent_at < CLOSEST_S:
            self.counts["thinned"] += 1
            return False
        boot.sent_at = now
        w, x, y, z = (part / length for part in orientation)
        sequence, boot.readings = boot.readings, boot.readings + 1
        return self._send(
            wire.Reading(
                *(self._device_id, boot.nonce, boot.session, sequence, int(now * 1e6) % (1 << 32)),
                (w, x, y, z),
                *(_CALIBRATED, battery, wire.ROUND_TRIP_UNKNOWN, self.taps % 256, 0, self._flags),
            )
        )

    def turn(self, now: float) -> None:
        """Hear the stage, and look for it while there is something to send. Call it now and then."""
        self._follow_door(now)
        self._receive(now)
        boot = self._boot
        if boot.session and now - boot.heard >= LOST_S:
            boot.session = 0
        if self._has_news and not boot.session and now >= boot.hello_at and self._socket is not None:
            self._has_news, boot.hello_at = False, now + HELLO_EVERY_S
            sequence, boot.hellos = boot.hellos, boot.hellos + 1
            imu_id = self.source.encode()[:16].ljust(16, b"\0")
            self._send(
                wire.Hello(
                    *(self._device_id, boot.nonce, 0, sequence, wire.WIRE_HASH, *_NO_FIRMWARE),
                    *(self._battery, self._flags),
                    imu_id=imu_id,
                )
            )

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _follow_door(self, now: float) -> None:
        found = self._door.look(now)
        if found is None or found == self._found:
            return
        self.close()
        self._found, self._boot.session = found, 0
        port, secret = found
        key = foreign_key(self.name, self.source, secret)
        self._device_id, self._tagger = key.device_id, wire.Tagger(key.key)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        with contextlib.suppress(OSError):  # nothing is sent then, and the next door is another port
            self._socket.connect((LOOPBACK, port))

    def _receive(self, now: float) -> None:
        while self._socket is not None:
            try:
                received = self._socket.recv(_LONGEST)
            except BlockingIOError:
                return
            except OSError:  # refused: the stage is away
                self._boot.session = 0
                return
            with contextlib.suppress(wire.WireError):
                self._hear(wire.unpack(received, self._tagger_of), now)

    def _tagger_of(self, device: int) -> wire.Tagger | None:
        return self._tagger if device == self._device_id else None

    def _hear(self, packet: wire.Packet, now: float) -> None:
        boot = self._boot
        if packet.boot_nonce != boot.nonce:
            return
        newest = boot.hellos - 1
        if isinstance(packet, wire.Assignment):
            if max(newest - _ANSWERED_HELLOS, boot.answered) < packet.hello_sequence <= newest:
                boot.answered, boot.session = packet.hello_sequence, packet.session
                boot.heard, boot.led = now, packet.led
        elif isinstance(packet, wire.Heartbeat) and packet.session == boot.session:
            boot.heard, boot.led = now, packet.led
        elif isinstance(packet, wire.Call):
            boot.session = 0

    def _send(self, packet: wire.Packet) -> bool:
        if self._socket is None:
            return False
        try:
            self._socket.send(wire.pack(packet, self._tagger))
        except OSError:  # refused, or full: the stage is away
            return False
        return True
