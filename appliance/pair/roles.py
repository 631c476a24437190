"""Which of two boxes leads: a state machine without clock, sockets or show."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from appliance.box.clock import TICK_S

FIRST_WAITS_S = 0.4  # at the start, for a box that leads already; the second leaves the first time to start
SECOND_WAITS_S = 6.0
UNREADY_WAITS_S = 2.0  # a follower that knows no dance yet gives the first's stage time to restart
YIELDS_S = 0.15  # a leader that gave back and hears nobody leads again
SHORT_S = 2.0  # a box that lost the lead so soon after it took it waits a tick longer to take it again
MOST_PATIENCE_S = 0.3
PATIENCE_FOR_S = 10.0
CABLE_S = 3.0  # a card says that its cable is out within that time
FRESH_S = 0.1  # a lead is given only to a box that was heard so lately
SILENCE, CABLE = "the other one is silent", "this box's cable is out"


class Role(IntEnum):
    """The part of a box; all but LEADS are silent."""

    WAITS = 0
    FOLLOWS = 1
    LEADS = 2
    YIELDS = 3  # it has led until now, and asks the other one to lead


class Heard(NamedTuple):
    """The part of the other box, as its datagram says. is_ready: it could take over at any moment.

    as_of: deadline of a leader's newest frame, in seconds. It is as good as its frames: however late one
    hears of them, one takes over at the same moment. Others: inf, which means when it is heard.
    """

    role: Role
    epoch: int
    is_ready: bool
    as_of: float = math.inf


@dataclass
class Roles:
    """The part of one box. Times are this machine's monotonic seconds.

    epoch: a number that grows with each change of the leader: of two leaders the one with the lower epoch
    is silent, and where both are equal the second box. patience_s: a follower takes over when that much time
    has passed since the deadline of the leader's newest frame. takeovers: since the start. why, since: of
    the newest change, in a word and in seconds.
    """

    is_first: bool
    now: float
    silent_s: float
    role: Role = Role.WAITS
    epoch: int = 0
    takeovers: int = 0
    why: str = "start"

    def __post_init__(self) -> None:
        self.patience_s = self.silent_s
        self.since = self.now
        self._heard_leader = self._heard = float("-inf")
        self._deposed_at = self._deaf_until = float("-inf")
        self._peer: Heard | None = None

    @property
    def leads(self) -> bool:
        """Whether this box may speak to receivers and sensors."""
        return self.role is Role.LEADS

    def peer_lives(self, now: float) -> bool:
        """Whether the other box was heard within the last second."""
        return now - self._heard < 1.0

    @property
    def peer(self) -> Heard | None:
        """The newest message of the other box."""
        return self._peer

    @property
    def heard(self) -> float:
        """When the other box was last heard."""
        return self._heard

    def hear(self, heard: Heard, now: float, is_ready: bool) -> None:
        """A datagram of the other box, authentic and new. is_ready: this box could take over."""
        self._heard, self._peer = now, heard
        if heard.role is Role.LEADS:
            self._heard_leader = max(self._heard_leader, min(heard.as_of, now))
            if self.role is not Role.LEADS:
                if self.role is not Role.FOLLOWS:
                    self._become(Role.FOLLOWS, now, "that one leads")
                self.epoch = max(self.epoch, heard.epoch)
            elif (heard.epoch, not self.is_first) > (self.epoch, self.is_first):
                if now - self.since < SHORT_S:
                    self.patience_s = min(self.patience_s + TICK_S, MOST_PATIENCE_S)
                    self._deposed_at = now
                self._become(Role.FOLLOWS, now, "that one took over")
                self.epoch = heard.epoch
        elif heard.role is Role.YIELDS:
            self._heard_leader = now
            self.epoch = max(self.epoch, heard.epoch) if self.role is not Role.LEADS else self.epoch
            if self.role is Role.FOLLOWS and is_ready:
                self._lead(now, "that one gave it back")
        elif self.role is not Role.LEADS:
            self.epoch = max(self.epoch, heard.epoch)

    def begin(self, now: float) -> None:
        """The box is ready to hear: from now on it waits."""
        self.since = now

    def look(self, now: float, is_ready: bool, reaches: bool = True) -> None:
        """Changes that are due by time; call it at least once a tick.

        reaches: this box reaches the receivers. One whose cable is out hears nobody, and nobody hears it: it
        does not take over, and gives up the lead that it took before it knew: it has heard nobody since. One
        that is switched on without a cable dances, and follows any box that leads.
        """
        if now - self._deposed_at > PATIENCE_FOR_S:
            self.patience_s = self.silent_s
        if self.role is Role.WAITS:
            if now - self.since >= (FIRST_WAITS_S if self.is_first else SECOND_WAITS_S):
                self._lead(now, "no other box leads", int(reaches))
        elif self.role is Role.FOLLOWS:
            if not reaches:
                self._deaf_until = now
            elif now > self.takes_over_at(is_ready):
                self.takeovers += 1
                self._lead(now, SILENCE)
        elif self.role is Role.YIELDS and now - self.since > YIELDS_S:
            self._lead(now, "the other one did not take it", int(reaches))
        elif self.leads and not reaches and self._took_over_blindly(now):
            self.epoch -= 1
            self._become(Role.FOLLOWS, now, CABLE)

    def _took_over_blindly(self, now: float) -> bool:
        return self.why == SILENCE and self._heard <= self.since and now - self.since < CABLE_S

    def takes_over_at(self, is_ready: bool) -> float:
        """When a follower that hears nothing more of the leader takes over.

        Silence counts from when this box could hear: of a cable that comes back, a datagram comes first that
        waited in the network for an address to answer.
        """
        patience_s = self.patience_s if is_ready else max(UNREADY_WAITS_S, self.patience_s)
        return max(self._heard_leader, self._deaf_until, self.since) + patience_s

    def give_back(self, now: float) -> bool:
        """Ask the other box to lead, which could; whether it is asked."""
        peer = self._peer
        if not self.leads or now - self._heard > FRESH_S or peer is None or not peer.is_ready:
            return False
        self._become(Role.YIELDS, now, "given back")
        return True

    def _lead(self, now: float, why: str, step: int = 1) -> None:
        self.epoch += step
        self._become(Role.LEADS, now, why)

    def _become(self, role: Role, now: float, why: str) -> None:
        self.role, self.since, self.why = role, now, why
