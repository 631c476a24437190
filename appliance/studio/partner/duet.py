"""A duet in the studio: a partner answers a recording as it does on the stage, tick by tick."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appliance.dancer.continuation import FREE, Continuation
from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.partner_network import PartnerNetwork
from appliance.dancer.material.steps import HOP, floor_under
from appliance.dancer.step_memory import StepMemory
from appliance.dancer.turns import answerer_leads
from appliance.pose.recording import Recording

LEAD_IN = 100  # ticks of its recording before the partner goes on by itself
FADE_S = 0.5


@dataclass
class _Dancer:
    memory: StepMemory
    continuation: Continuation
    poses: list[np.ndarray]
    roots: list[np.ndarray]


def danced_duet(
    network: ImproviserNetwork,
    partner: PartnerNetwork,
    led: Recording,
    own: Recording,
    follow: float = 1.0,
    lead: float = 0.0,
    delay_s: float = 0.0,
    seed: int = 1,
    goal: tuple[float, float] | None = None,
) -> tuple[Recording, Recording]:
    """Both dances: the led one's, which is its recording but for the stretches in which the partner leads,
    and the partner's, which begins with its own recording. Both as long as `led`.
    """
    recordings = [_on_the_floor(one) for one in (led, own)]
    dancers = [
        _Dancer(
            StepMemory(network, network.places, phase),
            Continuation(network, partner, len(one.skeleton)),
            [],
            [],
        )
        for phase, one in zip((0, 2), recordings, strict=True)
    ]
    first, second = dancers
    for tick in range(len(led)):
        leads = lead > 0 and answerer_leads(tick, lead, seed)
        if tick == LEAD_IN:
            second.continuation.choose(True, FADE_S)
        if tick >= LEAD_IN and first.continuation.is_chosen != leads:
            first.continuation.choose(leads, FADE_S)
        for number, (one, other, recording) in enumerate(
            ((first, second, recordings[0]), (second, first, recordings[1]))
        ):
            frames = (
                np.minimum(np.arange(tick, tick + 8), len(recording) - 1)
                if not number
                else (np.arange(tick, tick + 8) % len(recording))
            )
            window = recording.poses[frames].astype(np.float32)
            roots = recording.roots[frames].astype(np.float32)
            continuation = one.continuation
            continuation.follow = FREE if number and leads else follow
            continuation.delay_steps = round(delay_s / 0.02 / HOP)
            continuation.goal = goal if number else None
            rng = np.random.Generator(np.random.Philox(key=[seed + 1000 * number, tick]))
            window, roots = continuation.lay_over(window, roots, one.memory, other.memory, rng)
            one.poses.append(window[0].copy())
            one.roots.append(roots[0].copy())
        for one in dancers:
            one.memory.watch(one.poses[-1], one.roots[-1])
    made = [
        replace(recording, poses=np.array(one.poses, float), roots=np.array(one.roots, float))
        for one, recording in zip(dancers, recordings, strict=True)
    ]
    return made[0], made[1]


def _on_the_floor(recording: Recording) -> Recording:
    roots = recording.roots.copy()
    roots[:, 1] -= floor_under(recording)
    return replace(recording, roots=roots)
