"""A box that comes back into step: no joint jumps, and at the end the frames are the leader's own."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from appliance.dancer.forward_kinematics import Figure
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose import quaternion
from appliance.stage.rejoining import Rejoining
from tests.bundles import FIGURE

FADE_S, TICKS = 0.5, 40
SIDEWAYS = np.array([0.0, 0.0, 1.0])


def frame_at(tick: int, degrees: float, x_m: float) -> JointFrame:
    """All joints swing, from a place `degrees` off; the root stands at x."""
    puppet = PuppetFrame.of(len(FIGURE))
    angle = np.radians(degrees) + 0.2 * np.sin(0.1 * tick)
    puppet.pose[:] = quaternion.from_axis_angle(SIDEWAYS, angle)
    puppet.root[:] = x_m, 0.9, 0.0
    figure = Figure(FIGURE)
    figure.set_pose(puppet.pose, puppet.root)
    puppet.world[:], puppet.positions[:] = figure.world, figure.positions
    return JointFrame((puppet,), tick, 100.0 + 0.02 * tick)


def steps(frames: list[JointFrame]) -> tuple[float, float]:
    """The largest turn of a joint, degrees, and step of a joint's position, metres, between two frames."""
    turns, metres = [], []
    for before, after in pairwise(frames):
        one, two = before.puppets[0], after.puppets[0]
        turns.append(np.degrees(quaternion.angle_between(one.pose, two.pose)).max())
        metres.append(np.linalg.norm(one.positions - two.positions, axis=1).max())
    return float(max(turns)), float(max(metres))


def kept(frame: JointFrame) -> JointFrame:
    (puppet,) = frame.puppets
    copy = PuppetFrame.of(len(FIGURE))
    for name in ("root", "pose", "source", "world", "positions", "holds"):
        getattr(copy, name)[:] = getattr(puppet, name)
    return JointFrame((copy,), frame.tick, frame.frame_time)


@pytest.mark.parametrize(("degrees", "x_m"), [(70.0, 1.0), (-160.0, 0.0), (0.0, 0.0)])
def test_no_joint_jumps_and_the_end_is_the_leaders_own_frame(degrees: float, x_m: float) -> None:
    own = frame_at(500, degrees, x_m)
    leaders = [frame_at(tick, 0.0, 0.0) for tick in range(TICKS)]
    rejoining = Rejoining(FIGURE, own.puppets, FADE_S)
    assert rejoining.lead(own) is own
    rejoining.begin(own)
    led = [kept(own), *(kept(rejoining.lead(one)) for one in leaders)]
    usual, most = steps(leaders)[0], 1.5 * abs(degrees) / (FADE_S / 0.02)  # the ease's steepest slope
    turn, metres = steps(led)
    assert turn <= usual + most + 0.1
    assert metres <= 1.5 * x_m / (FADE_S / 0.02) + 2.0 * np.radians(turn)
    null, _ = steps([own, *leaders])
    assert null >= abs(degrees) - 25.0  # today's jump
    assert rejoining.lead(leaders[-1]) is leaders[-1]
    (shown,) = led[10].puppets
    figure = Figure(FIGURE)
    figure.set_pose(shown.pose, shown.root)
    assert np.allclose(figure.positions, shown.positions) and np.allclose(figure.world, shown.world)


def test_a_second_return_while_the_first_is_under_way_goes_on_from_what_is_shown() -> None:
    own, leader = frame_at(500, 70.0, 1.0), frame_at(3, 0.0, 0.0)
    rejoining = Rejoining(FIGURE, own.puppets, FADE_S)
    rejoining.begin(own)
    for _ in range(8):
        shown = kept(rejoining.lead(leader))
    rejoining.begin(leader)
    again = kept(rejoining.lead(frame_at(90, -30.0, 2.0)))
    assert steps([shown, again])[0] < 0.1


def test_a_box_that_has_shown_nothing_yet_shows_the_leader_at_once() -> None:
    never_left = frame_at(0, 70.0, 1.0)
    never_left.frame_time = 0.0
    rejoining = Rejoining(FIGURE, never_left.puppets, FADE_S)
    rejoining.begin(never_left)
    leader = frame_at(1, 0.0, 0.0)
    assert rejoining.lead(leader) is leader
