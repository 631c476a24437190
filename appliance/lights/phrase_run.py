"""The rig while a phrase dances, without stage, wires or clock: for pictures and warnings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.levers.show_state import ShowState
from appliance.levers.table import LIGHTS
from appliance.lights.patch import Patch, Values
from appliance.lights.rig import Rig
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose.recording import Recording
from appliance.show.lights import LightsConfig

_SETTLING_S = 5.0  # every head has arrived


class Pass(NamedTuple):
    """One pass: its second of the phrase, the dancer's joints, the rig's values (S,).

    places: (J, 3) metres; turns: (J, 4) their orientations in the world.
    """

    second: float
    places: NDArray[np.float64]
    turns: NDArray[np.float64]
    values: Values


def passes(
    config: LightsConfig, patch: Patch, phrase: Recording, mapping: str, start: int, end: int, step: int = 1
) -> Iterator[Pass]:
    """Dance frames start to end (without it) of the phrase under a mapping, "": the first one.

    Every step-th frame is a pass. Before the first one the heads have reached it; the patch holds their
    positions.
    """
    step_s = step / phrase.fps
    rig = Rig(config, patch, phrase.skeleton, 1.0 / step_s)
    rig.safety = 0.0
    in_force = ShowState().to(LIGHTS, mapping).to(LIGHTS, mapping)
    settling = round(_SETTLING_S / step_s)
    places = np.concatenate([np.full(settling, start), np.arange(start, end, step)])
    for tick, place in enumerate(places):
        frame = _frame(phrase, int(place), tick, step_s)
        rig.render(frame, 1, in_force, frame.frame_time)
        if tick >= settling:
            dancer = frame.puppets[0]
            places, turns = dancer.positions.astype(float), dancer.world.astype(float)
            yield Pass(float(place / phrase.fps), places, turns, rig.values)


def _frame(phrase: Recording, place: int, tick: int, step_s: float) -> JointFrame:
    """One instant of the phrase, as the stage would show it."""
    pose, root = phrase.poses[place], phrase.roots[place]
    positions, world = phrase.skeleton.forward_kinematics(pose, root)
    free = np.zeros(len(pose))
    small = [np.asarray(part, np.float32) for part in (root, pose, pose, world, positions, free)]
    return JointFrame((PuppetFrame(*small),), tick, tick * step_s)
