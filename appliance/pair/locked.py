"""Boxes in step: one always leads, and each of the others follows it or dances by itself."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.pair.pair import Pair, PairSettings
from appliance.pair.roles import Heard, Role, Roles


class FixedRoles(Roles):
    """The first box leads, whatever it hears; the second follows it whenever it is there."""

    def hear(self, heard: Heard, now: float, is_ready: bool) -> None:
        """A datagram of the other box, authentic and new."""
        self._heard, self._peer = now, heard
        if self.is_first or heard.role is not Role.LEADS:
            return
        self._heard_leader = now
        self.epoch = max(self.epoch, heard.epoch)
        if self.role is not Role.FOLLOWS:
            self._become(Role.FOLLOWS, now, "that one leads")

    def give_back(self, now: float) -> bool:
        """Nothing is given back."""
        return False


class LockedPair(Pair):
    """The link to one other box."""

    ROLES = FixedRoles


class Followers(LockedPair):
    """The leader's links: to the first box that follows, and to the others."""

    def __init__(self, settings: Sequence[PairSettings], fingerprint: bytes, now: float) -> None:
        super().__init__(settings[0], fingerprint, now)
        self.others = [LockedPair(one, fingerprint, now) for one in settings[1:]]

    @property
    def links(self) -> tuple[LockedPair, ...]:
        """All of them."""
        return self, *self.others

    def look(self, now: float) -> None:
        """Hear all of them."""
        super().look(now)
        for one in self.others:
            one.look(now)
            self.wants_keyframe |= one.wants_keyframe

    def publish(self, message: bytes, now: float) -> None:
        """To all of them."""
        super().publish(message, now)
        for one in self.others:
            one.publish(message, now)

    def answer(self, now: float) -> None:
        """To each what it asked for."""
        super().answer(now)
        for one in self.others:
            one.answer(now)

    def give_keyframe(self, keyframe: bytes) -> None:
        """To all that asked for it; those that did not need none."""
        super().give_keyframe(keyframe)
        for one in self.others:
            one.give_keyframe(keyframe)

    def lead_anew(self) -> None:
        """Messages begin anew."""
        super().lead_anew()
        for one in self.others:
            one.lead_anew()

    def close(self) -> None:
        """Free the ports."""
        super().close()
        for one in self.others:
            one.close()
