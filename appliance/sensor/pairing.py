"""One sensor's pairing: which power-on is let in, over which route, and which packets the box owes it.

A sensor that was switched on sends a hello; the assignment in answer gives it a session; its first reading
with that session puts the session in force. A session is a keyed hash of device, boot nonce and the number of
sessions in force before. So it needs no memory, an earlier boot can never come back after a later one, and
recordings from before a session are worthless after it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import blake2s
from itertools import islice
from math import inf
from typing import Generic, TypeVar

from appliance.sensor import wire
from appliance.sensor.sensor_key import SensorKey
from appliance.sensor.transports.transport import Route

A_TICK = 8  # answers: more than sensors need, and little work whatever is replayed
MOST_WAITING = 1024
REMEMBERED_BOOTS = 4096  # more than the power-ons of a sensor in the years that it keeps its key

Asked = TypeVar("Asked")

REMEMBERED = 64


class SequenceWindow:
    """The newest number, and which of the 64 up to it have come (RFC 4303, section 3.4.3)."""

    def __init__(self) -> None:
        self.newest = -1
        self._seen = 0  # bit n: the number n before the newest has come

    def staleness(self, sequence: int) -> str | None:
        """Why this number is not newer than all before: duplicate, reordered or old; None when it is."""
        age = self.newest - sequence
        if age < 0:
            return None
        if age >= REMEMBERED:
            return "old"
        return "duplicate" if self._seen >> age & 1 else "reordered"

    def advance(self, sequence: int) -> int:
        """Take a number as the newest. Returns how many before it are missing."""
        step = sequence - self.newest
        lost = step - 1 if self._seen else 0
        self._seen = (self._seen << step | 1) & (1 << REMEMBERED) - 1 if step < REMEMBERED else 1
        self.newest = sequence
        return lost


USUAL_RATE_HZ = 50
HEARTBEAT_S = 1.0
LOST_S = 3.0  # after this silence heartbeats stop; without them the sensor sends hellos
SILENT_S = 0.5  # while a linked sensor was heard within this, no other power-on is called
ASSIGNMENT_INTERVAL_S = 0.1
CALL_INTERVAL_S = 0.2
RESTORES = 5
AHEAD = 2  # no sensor counts its readings faster than this times its rate, whatever was lost
NO_HAND = 255


@dataclass(slots=True)
class Session:
    """The session in force."""

    boot_nonce: int
    number: int
    route: Route
    newest: wire.Reading  # the newest authentic reading
    heard: float  # its arrival
    readings: SequenceWindow
    profile_sequence: int = -1
    restores: int = 0


class Pairing:
    """State of one sensor. Time is an argument; packets come in authentic and leave by `due_packets`."""

    def __init__(
        self,
        key: SensorKey,
        secret: bytes,
        phase_s: float,
        hand: int = NO_HAND,
        rate_hz: int = USUAL_RATE_HZ,
    ) -> None:
        self.tagger = wire.Tagger(key.key)
        self.hand, self.rate_hz = hand, rate_hz
        self.session: Session | None = None
        self.greeted_at = -inf
        self.contested_at = -inf  # an ended power-on came back: a single sensor cannot do that
        self._device_id = key.device_id
        self._secret = secret
        self._phase_s = phase_s
        self._sessions_before = 0
        self._ended: dict[int, None] = {}  # boot nonces that were in force; the newest is the last
        self._hellos: dict[int, wire.Hello] = {}  # boot nonce -> its newest; the newest boot is the last
        self._unanswered: AnswerQueue[tuple[wire.Hello, Route]] = AnswerQueue(ASSIGNMENT_INTERVAL_S)
        self._uncalled: AnswerQueue[Route] = AnswerQueue(CALL_INTERVAL_S)
        self._next_heartbeat = -inf
        self._led: int | None = None
        self._sent: dict[type[wire.Packet], int] = {}

    # Cheap checks before the tag: why a packet is not new, or None when it may be.

    def hello_staleness(self, boot_nonce: int, sequence: int) -> str | None:
        before = self._hellos.get(boot_nonce)
        return "old_hello" if before is not None and sequence <= before.sequence else None

    def reading_staleness(self, boot_nonce: int, number: int, sequence: int, arrival: float) -> str | None:
        session = self.session
        if session is not None and boot_nonce == session.boot_nonce:
            if number != session.number:
                return "old_session"
            most = REMEMBERED + AHEAD * self.rate_hz * max(0.0, arrival - session.heard)
            is_ahead = sequence - session.readings.newest > most
            return "ahead" if is_ahead else session.readings.staleness(sequence)
        return None if number == self._number_for(boot_nonce) else "old_session"

    def profile_staleness(self, boot_nonce: int, number: int, sequence: int) -> str | None:
        session = self.session
        if session is None or (boot_nonce, number) != (session.boot_nonce, session.number):
            return "old_session"
        return "duplicate" if sequence <= session.profile_sequence else None

    def may_call(self, boot_nonce: int, now: float) -> bool:
        """Whether an authentic reading of an unknown session gets a call: no linked sensor is heard."""
        if self.session is not None and now - self.session.heard < SILENT_S:
            return False
        return self._uncalled.has_turn(boot_nonce, now)

    # Authentic, new packets.

    def take_hello(self, hello: wire.Hello, route: Route, now: float) -> str:
        """Take a hello. Returns its fate: hello, or other_wire when it gets no assignment.

        The session in force stays until a reading with the new session comes.
        """
        self._hellos.pop(hello.boot_nonce, None)
        self._hellos[hello.boot_nonce] = hello
        if len(self._hellos) > REMEMBERED_BOOTS:
            in_force = None if self.session is None else self.session.boot_nonce
            del self._hellos[next(boot_nonce for boot_nonce in self._hellos if boot_nonce != in_force)]
        self.greeted_at = now
        if hello.wire_hash != wire.WIRE_HASH:
            return "other_wire"
        self._unanswered.put(hello.boot_nonce, (hello, route))
        return "hello"

    def take_reading(self, reading: wire.Reading, route: Route, arrival: float) -> int:
        """Take a reading; its route becomes the sensor's. Returns how many before it are missing."""
        session = self.session
        if session is None or reading.boot_nonce != session.boot_nonce:
            if reading.boot_nonce in self._ended:
                self.contested_at = arrival
            if session is not None:
                self._ended[session.boot_nonce] = None
            if len(self._ended) > REMEMBERED_BOOTS:
                del self._ended[next(iter(self._ended))]
            session = self.session = Session(
                reading.boot_nonce, reading.session, route, reading, arrival, SequenceWindow()
            )
            self._sessions_before += 1
            self._next_heartbeat = -inf
        was_lost = arrival - session.heard >= LOST_S
        session.newest, session.heard, session.route = reading, arrival, route
        missing = session.readings.advance(reading.sequence)
        return 0 if was_lost else missing  # without a link a sensor does not stream

    def take_profile(self, profile: wire.Profile) -> None:
        """Take a calibration of the session in force."""
        if self.session is not None:
            self.session.profile_sequence = profile.sequence

    def queue_call(self, boot_nonce: int, route: Route) -> None:
        """Ask the sensor of an unknown session for a hello."""
        self._uncalled.put(boot_nonce, route)

    def owe_nothing(self) -> None:
        """Another box answers."""
        self._unanswered.clear()
        self._uncalled.clear()

    # Packets to the sensor.

    def due_packets(
        self, now: float, led: int, profiles: Mapping[bytes, bytes]
    ) -> Iterator[tuple[Route, wire.Packet]]:
        """The packets to send now, and where to: assignments, calls, a heartbeat, a calibration."""
        for boot_nonce, (hello, route) in self._unanswered.take_due(now):
            head = self._head(wire.Assignment, boot_nonce, self._number_for(boot_nonce))
            yield route, wire.Assignment(*head, hello.sequence, self.hand, self.rate_hz, led)
        for boot_nonce, route in self._uncalled.take_due(now):
            yield route, wire.Call(*self._head(wire.Call, boot_nonce, 0))
        session = self.session
        is_due = now >= self._next_heartbeat or led != self._led
        if session is not None and self.route(now) is not None and is_due:
            self._led = led
            self._next_heartbeat = now + HEARTBEAT_S - (now - self._phase_s) % HEARTBEAT_S
            yield session.route, self._heartbeat(session, now, led)
            restore = self._restore(session, profiles)
            if restore is not None:
                yield session.route, restore

    def route(self, now: float) -> Route | None:
        """The route to the sensor while it is linked."""
        session = self.session
        return session.route if session is not None and now - session.heard < LOST_S else None

    @property
    def hello(self) -> wire.Hello | None:
        """The newest hello of the boot in force; without one in force, the newest of all."""
        return self.newest_hello if self.session is None else self._hellos.get(self.session.boot_nonce)

    @property
    def newest_hello(self) -> wire.Hello | None:
        return next(reversed(self._hellos.values()), None)

    def _number_for(self, boot_nonce: int) -> int:
        """The session that this boot has or would get: 32 bits, never 0."""
        if self.session is not None and boot_nonce == self.session.boot_nonce:
            return self.session.number
        drawn = struct.pack("<III", self._device_id, boot_nonce, self._sessions_before)
        return int.from_bytes(blake2s(drawn, key=self._secret, digest_size=4).digest(), "little") or 1

    def _heartbeat(self, session: Session, now: float, led: int) -> wire.Heartbeat:
        head = self._head(wire.Heartbeat, session.boot_nonce, session.number)
        held_us = max(0, round((now - session.heard) * 1e6))
        return wire.Heartbeat(*head, session.readings.newest, held_us, led)

    def _restore(self, session: Session, profiles: Mapping[bytes, bytes]) -> wire.Restore | None:
        """The calibration that this sensor's IMU lacks."""
        offsets = profiles.get(self.hello.imu_id) if self.hello is not None else None
        has_profile = session.newest.flags & wire.HAS_PROFILE
        if self.hello is None or offsets is None or has_profile or session.restores >= RESTORES:
            return None
        session.restores += 1
        head = self._head(wire.Restore, session.boot_nonce, session.number)
        return wire.Restore(*head, self.hello.imu_id, offsets)

    def _head(self, kind: type[wire.Packet], boot_nonce: int, number: int) -> tuple[int, int, int, int]:
        sequence = self._sent[kind] = self._sent.get(kind, 0) + 1
        return self._device_id, boot_nonce, number, sequence


class AnswerQueue(Generic[Asked]):
    """Questions by boot nonce; a power-on is answered at most once in `interval_s`.

    Power-ons that were never answered come first, so replayed ones wait behind a new one.
    """

    def __init__(self, interval_s: float) -> None:
        self._interval_s = interval_s
        self._new: dict[int, Asked] = {}  # never answered, longest wait first
        self._waiting: dict[int, Asked] = {}  # answered before, longest wait first
        self._answered_at: dict[int, float] = {}  # the newest answer is the last

    def has_turn(self, boot_nonce: int, now: float) -> bool:
        """Whether a question of this power-on would be answered: none waits, none was just answered."""
        answered_at = self._answered_at.get(boot_nonce, -inf)
        if boot_nonce in self._new or boot_nonce in self._waiting or now - answered_at < self._interval_s:
            return False
        has_room = len(self._new) + len(self._waiting) < MOST_WAITING
        return has_room or (answered_at == -inf and bool(self._waiting))

    def put(self, boot_nonce: int, asked: Asked) -> None:
        """Queue a question; it replaces one of this power-on that still waits."""
        queue = self._waiting if boot_nonce in self._answered_at else self._new
        queue[boot_nonce] = asked
        if len(self._new) + len(self._waiting) > MOST_WAITING:
            queue = self._waiting or self._new
            del queue[next(iter(queue))]

    def clear(self) -> None:
        """Owe nothing."""
        self._new.clear()
        self._waiting.clear()

    def take_due(self, now: float) -> Iterator[tuple[int, Asked]]:
        """Remove and give the questions to answer now, each with its boot nonce."""
        turns = [(boot_nonce, self._new) for boot_nonce in islice(self._new, A_TICK)]
        rested = (
            boot_nonce
            for boot_nonce in self._waiting
            if now - self._answered_at.get(boot_nonce, -inf) >= self._interval_s
        )
        turns += [(boot_nonce, self._waiting) for boot_nonce in islice(rested, A_TICK - len(turns))]
        for boot_nonce, queue in turns:
            self._answered_at.pop(boot_nonce, None)
            self._answered_at[boot_nonce] = now
            if len(self._answered_at) > REMEMBERED_BOOTS:
                del self._answered_at[next(iter(self._answered_at))]
            yield boot_nonce, queue.pop(boot_nonce)
