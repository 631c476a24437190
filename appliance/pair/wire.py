"""The pair's datagrams: authentic by a keyed tag, new by both boxes' numbers of this start.

Each box draws a number at its start, and every datagram names both: one that was recorded on another night
names a number that is no longer in force. Within a start a counter and a window keep repeats out.
"""

from __future__ import annotations

import math
import secrets
import struct
from typing import NamedTuple

from appliance.pair.roles import Heard, Role
from appliance.sensor.wire import TAG_BYTES, Tagger

MAGIC, VERSION = 0xB0A2, 2
# magic, version, kind; own number, the other's; counter; epoch, role, is ready; fingerprint; sent, as of
_HEAD = struct.Struct("<HBBQQQIBB8sdd")
BEAT, MESSAGE, KEYFRAME, ASK = range(1, 5)
KINDS = (BEAT, MESSAGE, KEYFRAME, ASK)
MOST_BODY = 1180  # with the heads of UDP and IP below what any Ethernet carries whole
LARGEST = _HEAD.size + MOST_BODY + TAG_BYTES
REASONS = ("accepted", "length", "magic", "version", "kind", "tag", "own", "greeting", "ended", "repeat")
_REMEMBERED = 256  # counters below the newest one
_MOST_ENDED = 1024


class Datagram(NamedTuple):
    """One that was accepted. sent, and `as_of` in heard: monotonic seconds of the other box."""

    kind: int
    heard: Heard
    fingerprint: bytes
    sent: float
    body: bytes


class Codec:
    """Packs this box's datagrams and accepts the other's. counts: datagrams by fate.

    greeting: number of a start of the other box that does not know this one's yet; 0: none.
    """

    def __init__(self, key: bytes, fingerprint: bytes) -> None:
        """fingerprint: 8 bytes of what both must have alike to dance alike."""
        self._tagger, self._fingerprint = Tagger(key), fingerprint
        self._own = secrets.randbits(64) | 1
        self._others = self.greeting = 0
        self._ended: dict[int, None] = {}  # numbers of the other box's earlier starts
        self._count = 0
        self._newest, self._seen = -1, 0  # bit n of seen: the counter n below the newest has come
        self.counts = dict.fromkeys(REASONS, 0)

    @property
    def others(self) -> int:
        """Number of the other box's start that is in force; 0 before the first."""
        return self._others

    def pack(self, kind: int, heard: Heard, now: float, body: bytes = b"", to: int = 0) -> bytes:
        """The next datagram. to: the start that it answers, where that is not the one in force."""
        self._count += 1
        head = _HEAD.pack(
            *(MAGIC, VERSION, kind, self._own, to or self._others, self._count),
            *(heard.epoch, heard.role, heard.is_ready, self._fingerprint, now, heard.as_of),
        )
        signed = head + body
        return signed + self._tagger.tag(signed)

    def accept(self, data: bytes) -> Datagram | None:
        """The datagram, where it is one of the other box, and new."""
        found = self._judge(data)
        fate = found if isinstance(found, str) else "accepted"
        self.counts[fate] += 1
        return None if isinstance(found, str) else found

    def _judge(self, data: bytes) -> Datagram | str:
        if not _HEAD.size + TAG_BYTES <= len(data) <= LARGEST:
            return "length"
        head = _HEAD.unpack_from(data)
        magic, version, kind, theirs, ours, count, epoch, role, is_ready, fingerprint, sent, as_of = head
        if magic != MAGIC:
            return "magic"
        if version != VERSION:
            return "version"
        if kind not in KINDS or role > Role.YIELDS or not math.isfinite(sent) or math.isnan(as_of):
            return "kind"
        if not self._tagger.is_authentic(data):
            return "tag"
        if theirs == self._own:
            return "own"
        if ours != self._own:  # it knows nothing of this start, or is of another night
            self.greeting = theirs
            return "greeting"
        if theirs != self._others:
            if theirs in self._ended:
                return "ended"
            self._begin(theirs)
        if not self._is_new(count):
            return "repeat"
        body = data[_HEAD.size : -TAG_BYTES]
        return Datagram(kind, Heard(Role(role), epoch, bool(is_ready), as_of), fingerprint, sent, body)

    def _begin(self, theirs: int) -> None:
        """Another start of the other box is in force."""
        if self._others:
            self._ended[self._others] = None
        if len(self._ended) > _MOST_ENDED:
            del self._ended[next(iter(self._ended))]
        self._others, self._newest, self._seen = theirs, -1, 0

    def _is_new(self, count: int) -> bool:
        """As RFC 4303, section 3.4.3, but an older one that has not come yet counts."""
        step = count - self._newest
        if step > 0:
            self._seen = (self._seen << min(step, _REMEMBERED) | 1) & (1 << _REMEMBERED) - 1
            self._newest = count
            return True
        if -step >= _REMEMBERED or self._seen >> -step & 1:
            return False
        self._seen |= 1 << -step
        return True
