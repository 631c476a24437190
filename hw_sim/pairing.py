"""The wearable's side of pairing, as in the firmware: when to send hellos, which answers count."""

from __future__ import annotations

from appliance.sensor import wire
from hw_sim.device import Lane

HELLO_EVERY_S = 0.5
HELLO_AFTER_CALL_S = 0.2  # shortest time between two answers to calls
LOST_S = 3.0  # without a packet from the box for this long, look for it again
ANSWERED_HELLOS = 4  # an assignment answers the newest hello or one of the three before
RESTORE_S = 10.0  # how long after the assignment a calibration from the box counts
REMEMBERED_READINGS = 64
LONGEST_ROUND_TRIP = wire.ROUND_TRIP_UNKNOWN - 1  # 0.1 ms


class Pairing:
    """One power-on: from the first hello to the last heartbeat. Time is an argument, in seconds.

    lane: the link's; None while looking for the box. session, led: the newest from the box.
    """

    def __init__(self, boot_nonce: int) -> None:
        self.boot_nonce = boot_nonce
        self.lane: Lane | None = None
        self.session = 0
        self.led = wire.LED_OFF
        self.rate_hz = 50
        self.round_trip = wire.ROUND_TRIP_UNKNOWN
        self._lanes_up: set[Lane] = set()
        self._hello_at: dict[Lane, float] = {}  # when the next one is due, for each lane that needs one
        self._hellos = 0
        self._answered_hello = -1
        self._hello_after_call = -HELLO_AFTER_CALL_S
        self._heard = 0.0
        self._assigned = 0.0
        self._heartbeats = self._restores = -1  # the newest sequence of each
        self._sent_at: dict[int, float] = {}  # reading sequence -> seconds

    @property
    def next_at(self) -> float:
        """When a hello is due, or the box counts as lost."""
        due = list(self._hello_at.values())
        if self.lane is not None:
            due.append(self._heard + LOST_S)
        return min(due, default=float("inf"))

    def connect(self, lane: Lane, is_up: bool, now: float) -> None:
        """A lane to the box came up or went down."""
        if is_up:
            self._lanes_up.add(lane)
            if self.lane is None or lane > self.lane:
                self._hello_at[lane] = now
        else:
            self._lanes_up.discard(lane)
            self._hello_at.pop(lane, None)
            if self.lane == lane:
                self._look_for_the_box(now)

    def due_hellos(self, now: float) -> list[tuple[float, Lane, int]]:
        """The hellos that are due: time, lane, sequence number."""
        if self.lane is not None and now - self._heard >= LOST_S:
            self._look_for_the_box(self._heard + LOST_S)
        hellos = []
        for lane, at in sorted(self._hello_at.items()):
            if at > now:
                continue
            hellos.append((at, lane, self._hellos))
            self._hellos += 1
            if self.lane is None or lane > self.lane:
                missed = int((now - at) / HELLO_EVERY_S)
                self._hello_at[lane] = at + (missed + 1) * HELLO_EVERY_S
            else:
                del self._hello_at[lane]  # one hello answers a call
        return hellos

    def reading_sent(self, sequence: int, at: float) -> None:
        """Note when a reading left, for the round trip."""
        self._sent_at[sequence] = at
        self._sent_at.pop(sequence - REMEMBERED_READINGS, None)

    def take_assignment(self, packet: wire.Assignment, now: float, lane: Lane) -> bool:
        """Accept it if it answers one of the newest hellos. Its lane becomes the link's.

        A link stays as it is within its session; one by cable is not left for the network.
        """
        newest = self._hellos - 1
        is_answer = max(newest - ANSWERED_HELLOS, self._answered_hello) < packet.hello_sequence <= newest
        if not is_answer or not packet.session or lane not in self._lanes_up:
            return False
        self._answered_hello = packet.hello_sequence
        is_better_linked = self.lane is not None and self.lane > lane
        if is_better_linked or (self.lane == lane and packet.session == self.session):
            return False
        if self.lane is None or packet.session != self.session:
            self._assigned = now
        if packet.session != self.session:
            self.session = packet.session
            self._heartbeats = self._restores = -1
        self.lane, self.led, self.rate_hz = lane, packet.led, packet.rate_hz
        self._heard = now
        self._hello_at = {other: at for other, at in self._hello_at.items() if other > lane}
        return True

    def take_heartbeat(self, packet: wire.Heartbeat, now: float) -> None:
        """Accept it in the link's session and in rising order only."""
        if self.lane is None or packet.session != self.session or packet.sequence <= self._heartbeats:
            return
        self._heartbeats = packet.sequence
        self._heard = now
        self.led = packet.led
        sent_at = self._sent_at.get(packet.echo_sequence)
        if sent_at is not None:
            round_trip = round(1e4 * (now - sent_at - packet.echo_held_us * 1e-6))
            self.round_trip = min(max(round_trip, 0), LONGEST_ROUND_TRIP)

    def take_call(self, now: float, lane: Lane) -> None:
        """The restarted box does not know the session: hello at once, streaming continues."""
        if lane in self._lanes_up and now - self._hello_after_call >= HELLO_AFTER_CALL_S:
            self._hello_after_call = now
            self._hello_at[lane] = now

    def take_restore(self, packet: wire.Restore, now: float) -> bool:
        """Whether a calibration from the box counts: soon, in the link's session and in rising order only."""
        is_late = self.lane is None or now - self._assigned >= RESTORE_S
        if is_late or packet.session != self.session or packet.sequence <= self._restores:
            return False
        self._restores = packet.sequence
        return True

    def _look_for_the_box(self, now: float) -> None:
        self.lane, self.round_trip = None, wire.ROUND_TRIP_UNKNOWN
        self._hello_at = dict.fromkeys(self._lanes_up, now)
