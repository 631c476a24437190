"""Where a dancer's joint goes: places within stay, others are brought in without a jump."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.dancer.reach import LEAST_M, WIDTH, reach_in
from appliance.pose import quaternion
from appliance.pose.recording import Recording


def test_the_places_of_a_phrase_are_within_reach_wherever_it_faces(swaying: Recording) -> None:
    skeleton = swaying.skeleton
    joint = skeleton.index("lShldr")
    turned = swaying.poses.copy()
    turned[:, 0] = quaternion.multiply(quaternion.from_axis_angle([0, 1, 0], 2.0), turned[:, 0])
    reach, again = (reach_in([poses], skeleton, joint) for poses in (swaying.poses, turned))
    assert again.middle == pytest.approx(reach.middle, abs=1e-5)
    assert again.axes == pytest.approx(reach.axes, abs=1e-5)
    places = skeleton.forward_kinematics(swaying.poses, np.zeros(3))[0][:, joint].astype(np.float32)
    for place in places[::7]:
        assert reach.bounded(place) == pytest.approx(place)


def test_a_place_outside_is_brought_in_and_never_jumps(swaying: Recording) -> None:
    reach = reach_in([swaying.poses], swaying.skeleton, swaying.skeleton.index("lShldr"))
    far = reach.middle + np.array((0, 0, 5), np.float32)
    near = reach.bounded(far)
    assert np.linalg.norm(np.linalg.solve(reach.axes, near - reach.middle)) == pytest.approx(1.0, abs=1e-4)
    assert WIDTH * LEAST_M - 1e-3 < np.linalg.norm(near - reach.middle) < 0.6
    angles = np.linspace(0, np.pi, 200)
    around = [np.array((np.sin(a), 0.3, np.cos(a)), np.float32) for a in angles]
    course = np.array([reach.bounded(reach.middle + place) for place in around])
    asked = np.linalg.norm(np.diff(around, axis=0), axis=1).max()
    assert np.linalg.norm(np.diff(course, axis=0), axis=1).max() < 1.5 * asked
