"""One box's end of the pair: sockets, the other box's clock, and what goes to and fro in each tick."""

from __future__ import annotations

import contextlib
import itertools
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from appliance.pair import wire
from appliance.pair.clock_offset import ClockOffset
from appliance.pair.roles import Heard, Role, Roles
from appliance.pair.stream import (
    Incoming,
    Outgoing,
    Parts,
    body_of,
    count_of,
    numbers_in,
    part_in,
    parts_of,
)
from appliance.pair.wire import Codec

_AT_ONCE = 256  # datagrams in one look
_PARTS_A_TICK = 12  # a keyframe is sent within some 5 ticks
_ASK_KEYFRAME_S = 0.06
_BUFFER_BYTES = 1 << 20
COPIES = 3  # sent at once: with a fifth of them lost, 0.8 % of ticks come a frame late; with one copy 20 %
REPEATS = 2  # it is sent again in the two ticks after it
BEATS = 2  # datagrams of a heartbeat
_TRY_AGAIN_S = 1.0
_OVERFLOWS_S = 0.4  # in a longer one more comes than is read at once, and then more than the socket holds
_STALE_S = 0.1  # the kernel keeps datagrams for an address that does not answer, and sends them seconds later
_KEYFRAME = 0  # first number of a question for a keyframe; messages are numbered from 1


@dataclass(frozen=True)
class PairSettings:
    """name: what the other box is called in words. host, port: where this one listens; peers: the other's
    addresses. silent_s: the follower takes over once the leader is silent for this long.
    """

    name: str
    is_first: bool
    host: str
    port: int
    peers: Sequence[str]
    key: bytes
    silent_s: float


class Pair:
    """Nothing here waits (but `await_datagram`), raises or logs.

    is_ready: this box could take over; reaches: see Roles.look; newest_frame: deadline of the newest frame
    that this box has sent. The stage sets these. wants_keyframe: the other box asked for one.
    same_show: whether the other box has the same show and software, as far as it was heard.
    heard_from: when each of its addresses was last heard. came_after: its newest datagram has waited here
    no longer than since then.
    """

    ROLES: type[Roles] = Roles

    def __init__(
        self,
        settings: PairSettings,
        fingerprint: bytes,
        now: float,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.settings, self._monotonic = settings, monotonic
        self.roles = self.ROLES(settings.is_first, now, settings.silent_s)
        self.offset = ClockOffset()
        self.is_ready = self.wants_keyframe = False
        self.reaches = True
        self.newest_frame = float("-inf")
        self.same_show = True
        self.heard_from = dict.fromkeys(settings.peers, float("-inf"))
        self.trouble = ""  # why nothing can be heard or sent
        self._fingerprint = fingerprint
        self._codec = Codec(settings.key, fingerprint)
        # One for each link: datagrams that wait for a dead one's address fill their socket's buffer.
        self._links = [(_udp_socket(), (peer, settings.port)) for peer in settings.peers]
        self._socket: socket.socket | None = None
        self._poll = select.poll()
        self._open_at = self._heard_at = self.came_after = float("-inf")
        self._outgoing, self._incoming = Outgoing(), Incoming()
        self._before: deque[list[bytes]] = deque(maxlen=REPEATS)  # bodies of the newest messages
        self._to_repeat: deque[int] = deque(maxlen=64)
        self._keyframe = 0, b""
        self._keyframe_parts: deque[int] = deque()
        self._coming: tuple[int, Parts] | None = None
        self._needs_keyframe = True
        self._asked_keyframe_at = float("-inf")
        self._start, self._epoch = 0, -1
        self._open(now)

    @property
    def leads(self) -> bool:
        """Whether this box may speak to receivers and sensors."""
        return self.roles.leads

    @property
    def has_other_secret(self) -> bool:
        """Whether all datagrams that came were signed with another secret."""
        return not self._codec.others and self._codec.counts["tag"] > 0

    @property
    def behind(self) -> int:
        """How many of the leader's messages the stage has not taken yet."""
        return self._incoming.newest - self._incoming.next + 1

    def await_datagram(self, seconds: float) -> None:
        """Wait until a datagram is there, at most so long, and not beyond a takeover that is due."""
        left_s = self.roles.takes_over_at(self.is_ready) - self._monotonic()
        if left_s > -seconds:
            seconds = min(seconds, left_s)
        if self._socket is None:
            time.sleep(max(0.0, seconds))
        elif seconds > 0.0:
            self._poll.poll(1000.0 * seconds)

    def look(self, now: float) -> None:
        """Hear what has come, and change the role where it is time.

        All that came before `now` is heard before the silence is judged, and counts as heard after that:
        however long this process is held up in between, it takes none for silent that is not.
        """
        self._hear(now)
        led = self.leads
        self.roles.look(now, self.is_ready, self.reaches)
        if led and not self.leads:
            self.follow_anew()

    def beat(self, now: float) -> None:
        """That this box is there, and what it does."""
        for _ in range(BEATS):
            self._send(wire.BEAT, now)

    def publish(self, message: bytes, now: float) -> None:
        """The leader, once a frame has left: the next message, and those before once more.

        Some copies are sent before those and some after, as losses come in bursts.
        """
        bodies = [*self._outgoing.put(message)]
        for body in itertools.chain(bodies, *self._before, (COPIES - 1) * bodies):
            self._send(wire.MESSAGE, now, body)
        self._before.append(bodies)
        self.beat(now)

    def answer(self, now: float) -> None:
        """The leader: what was asked for, a part at a time."""
        while self._to_repeat:
            for body in self._outgoing.again(self._to_repeat.popleft()):
                self._send(wire.MESSAGE, now, body)
        number, keyframe = self._keyframe
        for _ in range(min(_PARTS_A_TICK, len(self._keyframe_parts))):
            for body in parts_of(number, keyframe, [self._keyframe_parts.popleft()]):
                self._send(wire.KEYFRAME, now, body)

    def give_keyframe(self, keyframe: bytes) -> None:
        """The leader: the state after the newest message, for the other box."""
        self.wants_keyframe = False
        self._keyframe = self._outgoing.number, keyframe
        self._keyframe_parts = deque(range(count_of(keyframe)))

    def forget_state(self) -> None:
        """The follower: what it knows is of no use; the leader is asked for a keyframe."""
        self._needs_keyframe, self._coming = True, None
        self._asked_keyframe_at = float("-inf")

    def take_keyframe(self) -> bytes | None:
        """The follower: a keyframe that it needs, once it is whole; the messages go on after it."""
        if not self._needs_keyframe or self._coming is None:
            return None
        number, parts = self._coming
        if (whole := parts.whole) is None:
            return None
        self._coming, self._needs_keyframe = None, False
        self._incoming.begin_at(number + 1)
        return whole

    def take_message(self) -> bytes | None:
        """The follower: the next message, once it and all before are whole."""
        return None if self._needs_keyframe else self._incoming.take()

    def take_rest(self) -> Iterator[bytes]:
        """The box that takes over: what has come of messages behind one that is missing."""
        return iter(()) if self._needs_keyframe else self._incoming.take_rest()

    def ask(self, now: float) -> None:
        """The follower: ask for what is missing."""
        if self.roles.role is not Role.FOLLOWS:
            return
        if self._incoming.is_lost and not self._needs_keyframe:
            self.forget_state()
        if self._needs_keyframe:
            if now - self._asked_keyframe_at >= _ASK_KEYFRAME_S:
                self._asked_keyframe_at = now
                number, missing = 0, list[int]()
                if self._coming is not None:
                    number, missing = self._coming[0], self._coming[1].missing[:128]
                self._send(wire.ASK, now, body_of((_KEYFRAME, number, *missing)))
        elif missing := self._incoming.missing(now):
            self._send(wire.ASK, now, body_of(missing))

    def lead_anew(self) -> None:
        """This box has begun to lead: its messages begin anew, and none of before is repeated."""
        self._outgoing = Outgoing()
        self._before.clear()
        self._to_repeat.clear()
        self._keyframe, self.wants_keyframe = (0, b""), False
        self._keyframe_parts.clear()

    def follow_anew(self) -> None:
        """Another box leads, or another start of it."""
        self.is_ready = False
        self._incoming.restart()
        self.forget_state()

    def close(self) -> None:
        """Free the port."""
        for link, _ in self._links:
            link.close()
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open(self, now: float) -> None:
        self._open_at = now + _TRY_AGAIN_S
        made = _udp_socket()
        try:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
            made.bind((self.settings.host, self.settings.port))
        except OSError as error:
            made.close()
            self.trouble = f"UDP port {self.settings.port} on {self.settings.host}: {error.strerror}"
            return
        self.trouble, self._socket = "", made
        self._poll.register(made.fileno(), select.POLLIN)

    def _hear(self, now: float) -> None:
        if self._socket is None:
            if now >= self._open_at:
                self._open(now)
            return
        came = list[tuple[bytes, tuple[str, int]]]()
        with contextlib.suppress(OSError):
            while len(came) < _AT_ONCE:
                came.append(self._socket.recvfrom(wire.LARGEST + 1))
        now, before = self._monotonic(), self._heard_at
        for data, (sender, _) in came:
            found = self._codec.accept(data)
            if self._codec.greeting:
                self._greet(now)
            if found is not None:
                self._take(found, now, now - before)
                self.came_after = before
                if sender in self.heard_from:
                    self.heard_from[sender] = now
        self._heard_at = now

    def _greet(self, now: float) -> None:
        to, self._codec.greeting = self._codec.greeting, 0
        self._send(wire.BEAT, now, to=to)

    def _take(self, found: wire.Datagram, now: float, waited_s: float) -> None:
        """waited_s: at most so long it has waited here."""
        self.same_show = found.fingerprint == self._fingerprint
        start = self._codec.others
        if start != self._start:
            self._epoch = -1  # it may lead again with the same number
            self.offset.restart()
        self.offset.hear(found.sent, now)
        if now - found.sent - self.offset.seconds < _STALE_S + waited_s:
            as_of = now if waited_s > _OVERFLOWS_S else found.heard.as_of + self.offset.seconds
            self.roles.hear(found.heard._replace(as_of=as_of), now, self.is_ready)
        if (
            found.heard.role is Role.LEADS
            and not self.leads
            and (start, found.heard.epoch) != (self._start, self._epoch)
        ):
            self._epoch = found.heard.epoch
            self.follow_anew()
        self._start = start
        if found.kind == wire.ASK and self.leads:
            self._note_asked(numbers_in(found.body))
        elif found.kind == wire.MESSAGE and not self.leads:
            self._incoming.put(found.body)
        elif found.kind == wire.KEYFRAME and self._needs_keyframe and not self.leads:
            self._put_keyframe(found.body)

    def _note_asked(self, numbers: Sequence[int]) -> None:
        if not numbers or numbers[0] != _KEYFRAME:
            self._to_repeat.extend(one for one in numbers if one not in self._to_repeat)
            return
        number, missing = self._keyframe[0], numbers[2:]
        if number and numbers[1:2] == [number]:
            self._keyframe_parts.extend(one for one in missing if one not in self._keyframe_parts)
        elif not self._keyframe_parts:
            self.wants_keyframe = True

    def _put_keyframe(self, body: bytes) -> None:
        found = part_in(body)
        if found is None:
            return
        number, part, parts, payload = found
        if self._coming is None or self._coming[0] != number:
            self._coming = number, Parts(parts)
        if self._coming[1].parts == parts:
            self._coming[1].put(part, payload)

    def _send(self, kind: int, now: float, body: bytes = b"", to: int = 0) -> None:
        if self._socket is None:
            return  # it could not take over: it hears nothing
        heard = Heard(self.roles.role, self.roles.epoch, self.is_ready and self.same_show)
        if self.leads:
            heard = heard._replace(as_of=max(self.newest_frame, self.roles.since))
        data = self._codec.pack(kind, heard, now, body, to)
        for link, peer in self._links:
            with contextlib.suppress(OSError):  # no network there at this moment
                link.sendto(data, peer)


def _udp_socket() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
