"""Receives each frame of the box and measures its lateness from outside, by the kernel's time stamps."""

from __future__ import annotations

import select
import socket
import struct
import time

from hw_sim.osc_receiver import MalformedOscError, decode
from hw_sim.peers import FRAME, HOST
from hw_sim.receive_buffer import widen
from hw_sim.soak.delays import SLOT_MS, Delays, Seconds

SILENT_S = 0.5  # what the projector calls a pause
# Linux, asm-generic/socket.h: a time stamp for each datagram, and how many found no room.
_SO_TIMESTAMPNS, _SO_RXQ_OVFL = 35, 40
_BUFFER_BYTES = 8 << 20
_CLOSE_ENOUGH_S = 50e-6  # two clocks read one after the other; longer, and something came in between


class FrameWatch:
    """Receives `/bunraku/frame`. A frame's lateness is its arrival minus the deadline that it names.

    The stamps are made when the stage hands the datagram over, so a receiver that gets no processor measures
    as well as one that does. `late`: frames that say so themselves, or left later than `late_ms`; `missing`:
    ticks of which no frame came, but for those (`unheard`) that found no room here. `readings`: frames that
    carry a new one of the sensor that the tick follows.
    """

    def __init__(self, late_ms: float) -> None:
        self._late_ms = late_ms
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        widen(self._socket, _BUFFER_BYTES)
        for option in (_SO_TIMESTAMPNS, _SO_RXQ_OVFL):
            self._socket.setsockopt(socket.SOL_SOCKET, option, 1)
        self._socket.bind((HOST, 0))
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        self.heard = self.late = self.missing = self.unheard = self.stage_starts = 0
        self.longest_gap_s = 0.0
        self.delays, self.seconds = Delays(), Seconds()
        self.newest: float | None = None  # arrival, monotonic seconds
        self.readings = 0
        self._longest_without_s = self._reading_at = 0.0
        self._begun = 0.0
        self._tick = self._sequence = -1
        self._no_room = self._overflowed = 0
        self._wall_ahead_s = time.time() - time.monotonic()

    def start(self, now: float) -> None:
        """Reset all counts; seconds of the run count from here."""
        self.heard = self.late = self.missing = self.unheard = self.stage_starts = 0
        self.longest_gap_s = self._longest_without_s = 0.0
        self.readings = 0
        self.delays, self.seconds = Delays(), Seconds()
        self._begun = self._reading_at = now

    def poll(self, timeout_s: float) -> None:
        """Wait up to `timeout_s`, then take all that is there."""
        select.select([self._socket], [], [], timeout_s)
        self._compare_clocks()
        while True:
            try:
                datagram, reported, _, _ = self._socket.recvmsg(256, 128)
            except BlockingIOError:
                return
            if datagram.startswith(FRAME):
                self._hear(datagram, self._arrival(reported))

    def end(self, now: float) -> None:
        """Ticks that are overdue now are missing too."""
        if self.newest is not None and now - self.newest > SILENT_S:
            self._gap(self.newest, now)
            self._miss(now, int((now - self.newest) * 1000.0 / SLOT_MS))

    def without_reading_s(self, now: float) -> float:
        """The longest time until now in which no frame carried a new reading."""
        return max(self._longest_without_s, now - self._reading_at)

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()

    def _hear(self, datagram: bytes, arrival: float) -> None:
        try:
            (_, values), *_ = decode(datagram)
            tick, second, sequence, late, rest = (one for one in values if isinstance(one, int | float))
            deadline = second + rest
        except (MalformedOscError, ValueError):
            return
        lateness_ms = 1000.0 * (arrival - deadline)
        self._note_reading(int(sequence), arrival)
        self._count(int(tick), arrival)
        bad = bool(late) or lateness_ms > self._late_ms
        self.heard += 1
        self.late += bad
        self.delays.add(lateness_ms)
        self.seconds.note(int(arrival - self._begun), lateness_ms, int(bad))

    def _note_reading(self, sequence: int, arrival: float) -> None:
        if sequence >= 0 and sequence != self._sequence:
            self._sequence = sequence
            self.readings += 1
            self._longest_without_s = self.without_reading_s(arrival)
            self._reading_at = arrival

    def _count(self, tick: int, arrival: float) -> None:
        """The frames missing between the previous one and this one."""
        before, self._tick, newest = self._tick, tick, self.newest
        self.newest = arrival
        if newest is None:
            return
        self._gap(newest, arrival)
        if tick <= before:  # a new stage that counts from the beginning
            self.stage_starts += 1
            self._miss(arrival, int((arrival - newest) * 1000.0 / SLOT_MS))
        elif (gone := tick - before - 1) > 0:
            lost_here, self._overflowed = min(gone, self._overflowed), 0
            self.unheard += lost_here
            self._miss(arrival, gone - lost_here)

    def _gap(self, since: float, until: float) -> None:
        self.longest_gap_s = max(self.longest_gap_s, until - max(since, self._begun))

    def _miss(self, at: float, count: int) -> None:
        self.missing += count
        self.seconds.note(int(at - self._begun), count * SLOT_MS, count)

    def _arrival(self, reported: list[tuple[int, int, bytes]]) -> float:
        """Arrival time of the datagram, in monotonic seconds."""
        at = time.monotonic()
        for _, kind, data in reported:
            if kind == _SO_TIMESTAMPNS:
                seconds, nanoseconds = struct.unpack("qq", data[:16])
                at = seconds + nanoseconds * 1e-9 - self._wall_ahead_s
            elif kind == _SO_RXQ_OVFL:
                (no_room,) = struct.unpack("I", data[:4])
                self._overflowed += no_room - self._no_room
                self._no_room = no_room
        return at

    def _compare_clocks(self) -> None:
        """The stamps are wall-clock times, and that clock may be set at any moment."""
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        if after - before < _CLOSE_ENOUGH_S:
            self._wall_ahead_s = wall - (before + after) / 2.0
