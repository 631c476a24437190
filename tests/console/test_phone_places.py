"""Wherever a phone is worn, its joint turns as its dancer does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from appliance.console.phones import FRONTS
from appliance.pose import quaternion
from appliance.sensor.foreign.orientations import facing_front, from_device_angles, multiplied
from appliance.sensor.neutral import Mounting, NeutralPose, joint_from_reading, to_stage

# Alpha, beta and gamma of a phone in the neutral pose of a dancer that faces along x; z is up, y to the left.
WORN = {
    "left-arm": (180.0, 90.0, 0.0),  # upright, the screen to the left
    "right-arm": (0.0, 90.0, 0.0),  # upright, the screen to the right
    "hand": (-90.0, 0.0, 0.0),  # flat, the top edge to the front
    "chest": (90.0, 90.0, 0.0),  # upright, the screen to the front
}
Orientation = tuple[float, float, float, float]


def about(x: float, y: float, z: float, degrees: float) -> Orientation:
    half = math.radians(degrees) / 2
    sine = math.sin(half) / math.hypot(x, y, z)
    return math.cos(half), sine * x, sine * y, sine * z


@pytest.mark.parametrize("where", FRONTS)
@pytest.mark.parametrize("heading", [0.0, 130.0])
def test_a_turn_of_the_dancer_is_a_turn_of_the_joint(where: str, heading: float) -> None:
    def read(turn: Orientation) -> Orientation:
        """The reading that the stage gets of a phone after a turn of its limb, in the dancer's axes."""
        in_the_room = multiplied(about(0, 0, 1, heading), multiplied(turn, from_device_angles(*WORN[where])))
        return multiplied(in_the_room, facing_front(FRONTS[where]))

    neutral = joint_from_reading(NeutralPose(read((1.0, 0.0, 0.0, 0.0)), 0.0, 1), Mounting())
    for turn in (about(0, 1, 0, -60.0), about(1, 0, 0, 45.0), about(1, 2, 3, 100.0)):
        joint = neutral @ np.array(read(turn))
        assert float(quaternion.angle_between(joint, to_stage(turn))) < 1e-3
