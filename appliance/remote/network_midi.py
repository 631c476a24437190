"""MIDI by network: RTP-MIDI (RFC 6295) in a session that a computer or tablet opens, as macOS does."""

from __future__ import annotations

import contextlib
import secrets
import socket
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from appliance.remote.midi_messages import MidiParser
from appliance.sensor.transports.udp import bind_early
from appliance.show_control.midi_bindings import LONGEST_DEVICE
from appliance.show_control.port import Port

_COMMAND = b"\xff\xff"
_HEAD = struct.Struct(">2s2sIII")  # signature, command, version, initiator's token, sender
_CLOCK = struct.Struct(">2s2sIB3x3Q")
_FEEDBACK = struct.Struct(">2s2sIHH")
_RTP = struct.Struct(">BBHII")
_VERSION, _PAYLOAD_TYPE = 2, 0x61
_CLOCK_HZ = 10_000
_SILENT_S = (
    90.0  # a session is over when its clock was not set for so long; sides set it every 10 s or oftener
)
_FEEDBACK_S = 1.0
_MOST_SESSIONS = 8
_AT_ONCE = 64
_BYTES = {0x8: 2, 0x9: 2, 0xA: 2, 0xB: 2, 0xC: 1, 0xD: 1, 0xE: 2}
_SYSTEM_BYTES = {0xF1: 1, 0xF2: 2, 0xF3: 1}
_REAL_TIME = 0xF8
# Ends of a part of a system exclusive message: more comes; cancelled; left out by the sender; its end.
_PARTS_END = {0xF0: b"", 0xF4: b"\xf4", 0xF5: b"\xf7", 0xF7: b"\xf7"}

Address = tuple[str, int]


@dataclass
class _Session:
    name: str
    heard_at: float
    parser: MidiParser = field(default_factory=MidiParser)
    is_open: bool = False  # its clock was set, or MIDI came
    data: Address | None = None
    feedback_at: float = 0.0
    sent: int = 0


class NetworkMidi:
    """Two ports, `port` for the session and the one above it for MIDI. Raises OSError: one is taken.

    senders: addresses and networks that may open a session, beside this machine. Never waits.
    """

    def __init__(self, host: str, port: int, name: str, senders: Sequence[str] = ()) -> None:
        self._name = name.encode()[:60] + b"\0"
        self._own = secrets.randbits(32)
        self._sessions: dict[int, _Session] = {}
        self._sockets: list[socket.socket] = []
        self._ports: list[Port] = []
        try:
            for number in (port, port + 1):
                one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self._sockets.append(one)
                bind_early(one, (host, number))
                self._ports.append(Port(one, senders))
        except OSError:
            self.close()
            raise

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(session.name for session in self._sessions.values() if session.data is not None)

    @property
    def strangers(self) -> int:
        """How many datagrams came from others than the senders."""
        return sum(one.strangers for one in self._ports)

    def descriptors(self) -> list[int]:
        """To poll."""
        return [one.fileno() for one in self._sockets]

    def messages(self, now: float) -> Iterator[tuple[str, bytes]]:
        """The session's name and each MIDI message that has come; monotonic seconds."""
        for sender, session in list(self._sessions.items()):
            if now - session.heard_at > _SILENT_S:
                del self._sessions[sender]
        for one, port in zip(self._sockets, self._ports, strict=True):
            for _ in range(_AT_ONCE):
                if (found := port.take()) is None:
                    break
                received, address = found
                if received.startswith(_COMMAND):
                    with contextlib.suppress(struct.error):
                        self._answer(received, address, one, now)
                elif one is self._sockets[1]:
                    yield from self._midi(received, now)

    def send(self, name: str, message: bytes, now: float) -> None:
        for session in self._sessions.values():
            if session.name == name and session.data is not None and len(message) < 16:
                session.sent = session.sent + 1 & 0xFFFF
                head = _RTP.pack(
                    0x80, 0x80 | _PAYLOAD_TYPE, session.sent, _ticks(now) & 0xFFFFFFFF, self._own
                )
                self._put(self._sockets[1], session.data, head + bytes([len(message)]) + message)

    def close(self) -> None:
        """End the sessions and free both ports."""
        for session in self._sessions.values():
            if session.data is not None:
                self._put(self._sockets[0], (session.data[0], session.data[1] - 1), self._command(b"BY", 0))
        for one in self._sockets:
            one.close()

    def _command(self, command: bytes, token: int) -> bytes:
        return _HEAD.pack(_COMMAND, command, _VERSION, token, self._own)

    def _answer(self, received: bytes, address: Address, one: socket.socket, now: float) -> None:
        command = received[2:4]
        if command == b"IN":
            *_, token, sender = _HEAD.unpack_from(received)
            is_new = sender not in self._sessions
            if is_new and one is self._sockets[0]:
                self._make_room()
            if is_new and (len(self._sessions) >= _MOST_SESSIONS or one is not self._sockets[0]):
                self._put(one, address, self._command(b"NO", token))
                return
            if is_new:
                name = received[_HEAD.size :].partition(b"\0")[0].decode("utf-8", "replace")
                name = "".join(filter(str.isprintable, name))[:LONGEST_DEVICE]
                self._sessions[sender] = _Session(name or address[0], now)
            session = self._sessions[sender]
            session.heard_at = now
            if one is self._sockets[1]:
                session.data = address
            self._put(one, address, self._command(b"OK", token) + self._name)
        elif command == b"CK":
            *_, sender, count, first, _, _ = _CLOCK.unpack_from(received)
            session_of = self._sessions.get(sender)
            if session_of is None:
                return
            session_of.heard_at, session_of.is_open = now, True
            if count == 0:
                answer = _CLOCK.pack(_COMMAND, b"CK", self._own, 1, first, _ticks(now), 0)
                self._put(one, address, answer)
        elif command == b"BY":
            self._sessions.pop(_HEAD.unpack_from(received)[-1], None)

    def _make_room(self) -> None:
        """Where all places are taken, the oldest invitation that led to nothing makes room."""
        waiting = [sender for sender, session in self._sessions.items() if not session.is_open]
        if waiting and len(self._sessions) >= _MOST_SESSIONS:
            del self._sessions[min(waiting, key=lambda sender: self._sessions[sender].heard_at)]

    def _midi(self, received: bytes, now: float) -> Iterator[tuple[str, bytes]]:
        if len(received) < _RTP.size + 1:
            return
        first, kind, sequence, _, sender = _RTP.unpack_from(received)
        session = self._sessions.get(sender)
        if first >> 6 != 2 or kind & 0x7F != _PAYLOAD_TYPE or session is None:
            return
        session.is_open = True
        if now >= session.feedback_at and session.data is not None:  # lets the sender shorten its journal
            session.feedback_at = now + _FEEDBACK_S
            feedback = _FEEDBACK.pack(_COMMAND, b"RS", self._own, sequence, 0)
            self._put(self._sockets[0], (session.data[0], session.data[1] - 1), feedback)
        for message in session.parser.messages(commands_in(received[_RTP.size :])):
            yield session.name, message

    @staticmethod
    def _put(one: socket.socket, address: Address, packet: bytes) -> None:
        with contextlib.suppress(OSError):
            one.sendto(packet, address)


def commands_in(section: bytes) -> bytes:
    """The bytes of a MIDI command section (RFC 6295 section 3), without delta times and damaged ends.

    The recovery journal behind it is not read: a lost note is not played late.
    """
    flags, at = section[0], 1
    length = flags & 0x0F
    if flags & 0x80:
        length = (length << 8) | (section[1] if len(section) > 1 else 0)
        at = 2
    listed = section[at : at + length]
    found, at, status = bytearray(), 0, 0
    has_time = bool(flags & 0x20)
    while at < len(listed):
        if has_time:
            at = _after_time(listed, at)
            if at >= len(listed):
                break
        has_time = True
        begin = at
        if listed[at] >= _REAL_TIME:  # running status goes on behind it
            at += 1
            continue
        if listed[at] >= 0x80:
            status, at = listed[at], at + 1
        if status in (0xF0, 0xF7):  # whole, or a part of one
            while at < len(listed) and listed[at] not in _PARTS_END:
                at += 1
            if at >= len(listed):
                break
            found += listed[begin if status == 0xF0 else begin + 1 : at] + _PARTS_END[listed[at]]
            at, status = at + 1, 0
            continue
        if status < 0x80:
            break
        at += _BYTES.get(status >> 4, _SYSTEM_BYTES.get(status, 0))
        if at > len(listed):
            break
        found += listed[begin:at]
        status = status if status < 0xF0 else 0
    return bytes(found)


def _after_time(listed: bytes, at: int) -> int:
    """One to four bytes, of which all but the last begin with a one."""
    for _ in range(4):
        if at >= len(listed) or not listed[at] & 0x80:
            break
        at += 1
    return at + 1


def _ticks(now: float) -> int:
    return int(now * _CLOCK_HZ)
