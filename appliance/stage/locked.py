"""A stage in step with others: it tells them its ticks, or dances the leader's for its own outputs."""

from __future__ import annotations

from typing import Any

from appliance.box.clock import TickClock
from appliance.box.fallback import Fallbacks
from appliance.pair.locked import Followers, LockedPair
from appliance.pair.pair import Pair
from appliance.pair.roles import Role
from appliance.show.locked import LockedConfig
from appliance.show.pair import PairConfig
from appliance.stage.fallback import OUT_OF_STEP
from appliance.stage.paired import PairedStage, PairParts, settings_of
from appliance.stage.rejoining import Rejoining

_SILENT_MS = 200.0  # then a box that follows dances by itself
_REJOINS_S = 1.5  # in which its figures are led back to the leader's: as slowly as a puppet goes on by itself


class LockedStage(PairedStage):
    """As a pair's, but every box speaks to its own receivers, and the same one always leads."""

    def __init__(self, config: LockedConfig, stage: PairParts) -> None:
        self._links = _links(config)
        super().__init__(self._links[0], stage)
        self._rejoining = Rejoining(self._parts.skeleton, self._tick.frame.puppets, _REJOINS_S)
        if not self._settings.is_first:
            self._parts.outputs.altered_by = self._rejoining.lead

    def _open(self, fingerprint: bytes, now: float) -> Pair:
        settings = [settings_of(one) for one in self._links]
        if settings[0].is_first:
            return Followers(settings, fingerprint, now)
        return LockedPair(settings[0], fingerprint, now)

    def begin(self, now: float) -> None:
        """The box is ready to hear the others."""
        self.pair.roles.begin(now)

    def set_fallbacks(self, fallbacks: Fallbacks, now: float) -> None:
        """Once a second: which other boxes are not in step."""
        fallbacks.set(OUT_OF_STEP.name, self.complaint(now))

    def reported(self, now: float) -> dict[str, Any]:
        """For status: of each other box its address, since when it is silent, and whether it is in step."""
        boxes = [
            {
                "at": one.settings.peers[0],
                "silent_s": None if one.roles.heard == float("-inf") else now - one.roles.heard,
                "in_step": self._is_in_step(one, now),
                "same_show": one.same_show and not one.has_other_secret,
            }
            for one in self._ends
        ]
        behind = None if self._settings.is_first else self.pair.behind
        return {"in_step": {"behind": behind, "resyncs": self.resyncs, "boxes": boxes}}

    def _is_in_step(self, one: Pair, now: float) -> bool:
        peer = one.roles.peer
        if not one.same_show or peer is None or not one.roles.peer_lives(now):
            return False
        return peer.is_ready if self._settings.is_first else one.roles.role is Role.FOLLOWS and one.is_ready

    @property
    def _ends(self) -> tuple[Pair, ...]:
        return self.pair.links if isinstance(self.pair, Followers) else (self.pair,)

    def complaint(self, now: float) -> str:
        """Which other boxes are not in step, or ""."""
        for one in self._ends:
            at = one.settings.peers[0]
            if one.trouble:
                return f"The port to {at} cannot be opened ({one.trouble}). Free it."
            if one.has_other_secret:
                return f"The box at {at} has another secret: it dances by itself. Copy the file to it."
            if not one.roles.peer_lives(now):
                return (
                    f"The box at {at} is not heard: each dances by itself. Switch it on; look at the cable, "
                    "and at locked: in both box files."
                )
            if not one.same_show:
                return f"The box at {at} has another show or another release: it dances by itself."
        return ""

    def _sentence(self, role: Role) -> str:
        at = self._settings.peers[0]
        if self._settings.is_first:
            return "This box leads those that dance in step with it."
        return f"This box dances in step with {at}." if role is Role.FOLLOWS else "This box dances by itself."

    def _hear_leader(self) -> None:
        super()._hear_leader()
        self._parts.outputs.speaks_until = None

    def _restore(self, keyframe: bytes) -> None:
        self._rejoining.begin(self._tick.frame)
        super()._restore(keyframe)

    def _take_over(self, clock: TickClock) -> None:
        super()._take_over(clock)
        self._parts.outputs.speaks_until = None

    def _begin_tick(self, now: float) -> None:
        """A frame that comes late makes nobody here lose step: they wait for ten of them."""

    def _look_at_cable(self, now: float) -> None:
        """A cable that is out stops no other box: each has its own receivers."""


def _links(config: LockedConfig) -> list[PairConfig]:
    return [
        PairConfig.model_construct(
            role="second" if config.leader else "first",
            peer=[host],
            host=config.host,
            port=port,
            secret=config.secret,
            silent_ms=_SILENT_MS,
        )
        for host, port in config.ends
    ]
