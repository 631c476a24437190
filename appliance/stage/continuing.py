"""Puppets that go on by themselves: a partner that answers, after a live dancer, to a place in the room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.box.clock import TICK_S
from appliance.dancer.continuation import FREE, TEMPERATURE, TOP_P, Continuation
from appliance.dancer.lead import shortened
from appliance.dancer.live import SILENT_S
from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.partner_network import PartnerNetwork
from appliance.dancer.material.steps import HOP
from appliance.dancer.step_memory import StepMemory
from appliance.dancer.turns import answerer_leads
from appliance.pose import quaternion
from appliance.show.puppets import PuppetConfig
from appliance.stage.stage_puppet import StagePuppet

FADE_S, BACK_S = 1.5, 0.7  # into going on by itself, and back when the guest moves
MOVES_DEGREES_S = 12.0  # mean speed of a guest's joints, above which the guest moves; dancers have some 70
LED_M_S = 0.4  # the fastest that a puppet is led to its goal: a leg makes up for it while its foot stands
LED_S = 1.0  # in which a puppet would be led to a near goal
SWAY = 0.02  # share of a tick in the mean way to the goal: over a second, in which steps sway
_LOOK_TICKS = 10


class Guest:
    """Whether a live dancer moves: still_s, for how long not."""

    SNAPSHOT = ("_pose", "_ticks", "still_s")

    def __init__(self, joints: int) -> None:
        self._pose = np.tile(quaternion.IDENTITY, (joints, 1))
        self._ticks, self.still_s = 0, 0.0

    def look(self, puppet: StagePuppet, now: float) -> None:
        """Once a tick; a stream that is silent does not move."""
        live = puppet.live
        if live is None or not live.is_chosen:
            self._ticks, self.still_s = 0, 0.0
            return
        self.still_s += TICK_S
        self._ticks += 1
        if self._ticks % _LOOK_TICKS or live.silent_s(now) > SILENT_S:
            return
        newest = live.newest
        degrees = float(np.degrees(quaternion.angle_between(newest, self._pose)).mean())
        self._pose[:] = newest
        if degrees > MOVES_DEGREES_S * _LOOK_TICKS * TICK_S:
            self.still_s = 0.0


class Continuing:
    """Continuations of a stage's puppets, once a tick: lay_over after they start, watch once they stand.

    led, answerer: numbers of puppets; answerer None: no partner. follow, lead, delay_s: of the partner;
    temperature, top_p: of all that goes on; goal: x, z in metres on the stage, of the led puppet; (): none.
    """

    SNAPSHOT = (
        *("_continuations", "_memories", "_guest", "follow", "lead", "delay_s", "temperature", "top_p"),
        *("goal", "_off"),
    )

    def __init__(
        self,
        network: ImproviserNetwork,
        partner: PartnerNetwork | None,
        puppets: Sequence[StagePuppet],
        led: int,
        answerer: tuple[int, int, PuppetConfig] | None,
        after_s: float | None,
        temperature: float = TEMPERATURE,
        top_p: float = TOP_P,
    ) -> None:
        """answerer: its number, the number of the one that it answers, and its keys. after_s: how long a live
        dancer stands still before the led puppet goes on; None: it does not.
        """
        self._puppets, self._led, self._after_s = tuple(puppets), led, after_s
        self._pair = None if answerer is None else answerer[:2]
        self._numbers = sorted({*(() if after_s is None else (led,)), *(self._pair or ())})
        self._memories = [
            StepMemory(network, network.places, phase % HOP) for phase in range(len(self._numbers))
        ]
        joints = len(puppets[0].frame.pose)
        self._continuations = [Continuation(network, partner, joints) for _ in self._numbers]
        self._guest = Guest(joints)
        self.follow, self.lead, self.delay_s = FREE, 0.0, 0.0
        if answerer is not None:
            keys = answerer[2]
            self.follow, self.lead, self.delay_s = keys.follow, keys.lead, keys.delay
        self.temperature, self.top_p = temperature, top_p
        self.goal: tuple[float, ...] = ()
        self._off = 0.0, 0.0  # metres to the goal, without the sway of single steps

    def lay_over(self, tick: int, now: float, seed: int) -> None:
        """Lay what goes on over what the puppets have started from, for this tick of the stage."""
        self._guest.look(self._puppets[self._led], now)
        leads = self._pair is not None and answerer_leads(tick, self.lead, seed)
        for place, number in enumerate(self._numbers):
            puppet, one = self._puppets[number], self._continuations[place]
            one.temperature, one.top_p = self.temperature, self.top_p
            one.follow, one.delay_steps, one.goal = FREE, 0, None
            goes, fade_s, other = self._goes_alone(number, puppet, one), FADE_S, None
            if self._pair is not None and number in self._pair:
                answers, is_free = number == self._pair[0], leads == (number == self._pair[0])
                goes |= answers or (leads and not (puppet.live is not None and puppet.live.is_chosen))
                if not is_free:
                    other = self._memories[self._numbers.index(self._pair[1 if answers else 0])]
                    one.follow, one.delay_steps = self.follow, round(self.delay_s / TICK_S / HOP)
            if goes != one.is_chosen:
                one.choose(goes, fade_s if goes else BACK_S)
            still_steps = 0
            if number == self._led and self._guest.still_s:
                still_steps = round(self._guest.still_s / TICK_S / HOP)
            rng = np.random.Generator(np.random.Philox(key=[seed + number, tick]))
            window, roots = puppet.begun_with
            window, roots = one.lay_over(window, roots, self._memories[place], other, rng, still_steps)
            puppet.begin_with(window, roots, one.share)

    def watch(self) -> None:
        """See what the puppets have danced."""
        for memory, number in zip(self._memories, self._numbers, strict=True):
            grounding = self._puppets[number].grounding
            memory.watch(grounding.pose, grounding.root - grounding.shift * _ON_THE_FLOOR)

    def _goes_alone(self, number: int, puppet: StagePuppet, one: Continuation) -> bool:
        """Whether the led puppet goes on without a partner; its goal, if it has one."""
        if number != self._led or self._after_s is None:
            return False
        if self.goal:
            x, z = self.goal
            if puppet.place is not None:
                x, z = puppet.place.placement.inverse.point(x, z)
            shift = puppet.grounding.shift
            one.goal = x - float(shift[0]), z - float(shift[2])
            here = puppet.grounding.root
            away = x - float(here[0]) - self._off[0], z - float(here[2]) - self._off[1]
            self._off = self._off[0] + SWAY * away[0], self._off[1] + SWAY * away[1]
            puppet.lead.ask(*shortened(self._off[0] / LED_S, self._off[1] / LED_S, LED_M_S))
        else:
            self._off = 0.0, 0.0
        return bool(self.goal) or self._guest.still_s >= self._after_s


_ON_THE_FLOOR = np.array([1.0, 0.0, 1.0], np.float32)
