"""How joints move, as the SuperCollider pieces hear it: motions whose numbers are known, with Z up."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.outputs.motion_features import PAUSE_S
from appliance.outputs.osc.ai_toolbox import AiToolbox
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from hw_sim.osc_receiver import decode
from tests.outputs.small_stage import encoded, one_puppet

FIGURE = Skeleton(("a", "b", "c"), (-1, 0, 1), np.zeros((3, 3)))
UP = np.array([0.0, 1.0, 0.0])  # the box's; the pieces call it z
TURNS_RAD_S2, CIRCLES_RAD_S = 2.0, 4.0


class Piece:
    """A receiver of the first joint: it circles about the vertical, and turns faster and faster about it."""

    def __init__(self, **keys: object) -> None:
        self._frame = one_puppet(3)
        self._encoder = AiToolbox(FIGURE, OscConfig.model_validate({"program": "supercollider", **keys}))

    def at(self, second: float, late: bool = False) -> dict[str, np.ndarray]:
        frame, angle = self._frame, CIRCLES_RAD_S * second
        frame.frame_time, frame.late = 100.0 + second, late
        frame.puppets[0].positions[0] = np.cos(angle), 1.0, -np.sin(angle)
        frame.puppets[0].world[0] = quaternion.from_axis_angle(UP, TURNS_RAD_S2 * second**2 / 2)
        found = [decode(bytes(one))[0] for one in encoded(self._encoder, frame)]
        return {address: np.array(values).reshape(3, -1)[0] for address, values in found}

    def play(self, seconds: float) -> dict[str, np.ndarray]:
        for tick in range(round(seconds * 50) + 1):
            found = self.at(tick / 50)
        return found


def test_the_pieces_get_what_they_hear() -> None:
    """The addresses to which the pieces of MotionSonification respond, on their port."""
    found = Piece().play(1.0)
    assert OscConfig.model_validate({"program": "supercollider"}).port == 9005
    assert set(found) == {
        f"/mocap/joint/{name}" for name in ("pos_world", "rot", "rot_acc", "lin_acc", "ang_jerk")
    }
    assert found["/mocap/joint/pos_world"][2] == pytest.approx(1.0)  # the height
    np.testing.assert_allclose(found["/mocap/joint/rot"], [0, 0, 1.0], atol=1e-4)  # radians after 1 s
    np.testing.assert_allclose(found["/mocap/joint/rot_acc"], [0, 0, TURNS_RAD_S2], atol=0.05)
    assert np.linalg.norm(found["/mocap/joint/lin_acc"]) == pytest.approx(CIRCLES_RAD_S**2, rel=0.02)
    assert found["/mocap/joint/lin_acc"][2] == pytest.approx(0.0, abs=1e-3)
    assert found["/mocap/joint/ang_jerk"].shape == (1,)


def test_velocities_and_jerks_are_those_of_the_motion() -> None:
    names = ["lin_vel", "lin_jerk", "rot_vel", "ang_jerk"]
    found = {at.rpartition("/")[2]: one for at, one in Piece(messages=names).play(2.0).items()}
    np.testing.assert_allclose(found["rot_vel"], [0, 0, 2 * TURNS_RAD_S2], atol=0.05)
    assert np.linalg.norm(found["lin_vel"]) == pytest.approx(CIRCLES_RAD_S, rel=0.01)
    assert found["lin_jerk"] == pytest.approx([CIRCLES_RAD_S**3], rel=0.03)


def test_a_joint_that_has_turned_once_around_keeps_its_speed() -> None:
    """A quaternion and its negative are one orientation."""
    piece = Piece(messages=["rot_vel"])
    piece.play(4.0)
    (found,) = piece.at(4.02).values()
    np.testing.assert_allclose(found, [0, 0, 4.01 * TURNS_RAD_S2], atol=0.1)


def test_a_late_frame_repeats_the_numbers_and_a_pause_begins_anew() -> None:
    piece = Piece(messages=["lin_vel", "rot_vel", "rot_acc"])
    before = piece.play(1.0)
    assert all((values == before[at]).all() for at, values in piece.at(1.02, late=True).items())
    assert not any(values.any() for values in piece.at(1.02 + 2 * PAUSE_S).values())
