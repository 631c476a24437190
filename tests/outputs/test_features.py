"""Features: motions whose numbers are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from appliance.outputs.motion_features import PAUSE_S, WINDOW
from appliance.outputs.osc.features import Features
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from hw_sim.osc_receiver import decode
from tests.outputs.small_stage import encoded, one_puppet

JOINTS, STEP_S = 3, 0.02
FIGURE = Skeleton(("a", "b", "c"), (-1, 0, 1), np.zeros((JOINTS, 3)))
PLACES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]])
Way = Callable[[float], NDArray[np.float64]]


class Dancer:
    """All joints go the same way."""

    def __init__(self, way: Way, prefix: str = "/mocap/0/joint") -> None:
        self._way, self._frame = way, one_puppet(JOINTS)
        self._features = Features(FIGURE, OscConfig(dialect="features", prefix=prefix))

    def at(self, second: float, late: bool = False) -> dict[str, NDArray[np.float64]]:
        self._frame.frame_time, self._frame.late = 100.0 + second, late
        self._frame.puppets[0].positions[:] = PLACES + self._way(second)
        messages = [decode(bytes(one))[0] for one in encoded(self._features, self._frame)]
        return {address: np.array(values, float) for address, values in messages}

    def dance(self, frames: int) -> dict[str, NDArray[np.float64]]:
        for tick in range(frames):
            found = self.at(tick * STEP_S)
        return found


def straight(second: float) -> NDArray[np.float64]:
    return np.array([0.5 * second, 0.0, 0.0])


def falling(second: float) -> NDArray[np.float64]:
    return np.array([0.0, -second * second, 0.0])  # 2 m/s2


def there_and_back(second: float) -> NDArray[np.float64]:
    return np.array([0.0, 0.0, 0.1 - abs(0.1 - (second % 0.2))])


def circling(second: float) -> NDArray[np.float64]:
    return np.array([np.cos(4 * second), 0.0, np.sin(4 * second)])


@pytest.mark.parametrize("frames", [WINDOW // 2, WINDOW, 2 * WINDOW + 3])
def test_a_steady_way_is_direct_and_without_acceleration(frames: int) -> None:
    found = Dancer(straight).dance(frames)
    speeds = found["/mocap/0/joint/velocity"].reshape(JOINTS, 3)
    np.testing.assert_allclose(speeds, np.tile([0.5, 0, 0], (JOINTS, 1)), atol=1e-4)
    assert found["/mocap/0/qom"] == pytest.approx([0.5], abs=1e-4)
    assert found["/mocap/0/weight_effort"] == pytest.approx([0.25], abs=1e-3)
    assert found["/mocap/0/space_effort"] == pytest.approx([1.0], abs=1e-3)
    assert found["/mocap/0/time_effort"][0] < 0.02


def test_acceleration_and_jerk_are_those_of_the_motion() -> None:
    found = Dancer(falling).dance(2 * WINDOW)
    np.testing.assert_allclose(found["/mocap/0/joint/acceleration"].reshape(-1, 3)[1], [0, -2, 0], atol=0.01)
    assert found["/mocap/0/time_effort"] == pytest.approx([2.0], abs=0.02)
    jerked = Dancer(circling).dance(2 * WINDOW)
    sizes = np.linalg.norm(jerked["/mocap/0/joint/jerk"].reshape(-1, 3), axis=1)
    np.testing.assert_allclose(sizes, 64.0, rtol=0.02)  # radius 1 m, 4 rad/s
    assert jerked["/mocap/0/flow_effort"] == pytest.approx([64.0], rel=0.02)


def test_there_and_back_is_indirect_and_standing_still_is_not() -> None:
    assert Dancer(there_and_back).dance(3 * WINDOW)["/mocap/0/space_effort"][0] > 3.0
    still = Dancer(lambda _: np.zeros(3)).dance(2 * WINDOW)
    assert still["/mocap/0/space_effort"] == pytest.approx([1.0])
    assert still["/mocap/0/qom"] == [0.0]


def test_bounds_hold_all_joints() -> None:
    found = Dancer(lambda _: np.array([0.0, 1.0, 0.0])).dance(2)
    np.testing.assert_allclose(found["/mocap/0/bbox"], [0, 1, 0, 1, 3, 0], atol=1e-6)
    *centre, radius = found["/mocap/0/bsphere"]
    np.testing.assert_allclose(centre, [1 / 3, 5 / 3, 0], atol=1e-6)
    assert radius == pytest.approx(np.hypot(1 / 3, 4 / 3), abs=1e-6)


def test_a_late_frame_repeats_the_numbers_and_a_pause_begins_anew() -> None:
    dancer = Dancer(straight)
    before = dancer.dance(WINDOW)
    late = dancer.at(WINDOW * STEP_S, late=True)
    assert all((late[name] == before[name]).all() for name in before)
    after = dancer.at(WINDOW * STEP_S + 2 * PAUSE_S)
    assert not after["/mocap/0/joint/velocity"].any() and after["/mocap/0/weight_effort"] == [0.0]


def test_older_pieces_get_their_prefix() -> None:
    found = Dancer(straight, "/mocap/joint").dance(2)
    assert {"/mocap/joint/velocity", "/mocap/qom"} < set(found)


class Hand:
    """A hand that turns about one axis, and a live dancer beside it."""

    def __init__(self, number: int = 0) -> None:
        self._frame = one_puppet(JOINTS)
        self._frame.hands, self._frame.live = np.zeros((2, 4), np.float32), np.zeros((JOINTS, 3), np.float32)
        self._features = Features(
            FIGURE, OscConfig(dialect="features"), {1: "l Wrist"}, number, has_live=True
        )

    def at(self, second: float, radians: float, moved: float | None) -> dict[str, NDArray[np.float64]]:
        self._frame.frame_time = 100.0 + second
        self._frame.hands[1] = np.cos(radians / 2), 0.0, np.sin(radians / 2), 0.0
        self._frame.live[:] = 0.0 if moved is None else PLACES + np.array([moved, 0.0, 0.0])
        messages = [decode(bytes(one))[0] for one in encoded(self._features, self._frame)]
        return {address: np.array(values, float) for address, values in messages}


def test_a_hand_that_turns_steadily_has_its_angular_velocity_and_goes_straight() -> None:
    """Through half a turn and more, where a quaternion's sign and the shortest way change."""
    hand = Hand()
    for tick in range(3 * WINDOW):
        reported = hand.at(tick * STEP_S, 3.0 * tick * STEP_S, None)
    assert reported["/bunraku/hand/l_Wrist/velocity"] == pytest.approx([0.0, 3.0, 0.0], abs=1e-3)
    assert reported["/bunraku/hand/l_Wrist/qom"] == pytest.approx([3.0], abs=1e-3)
    assert reported["/bunraku/hand/l_Wrist/weight_effort"] == pytest.approx([9.0], abs=0.02)
    assert reported["/bunraku/hand/l_Wrist/space_effort"] == pytest.approx([1.0], abs=1e-3)
    assert np.abs(reported["/bunraku/hand/l_Wrist/acceleration"]).max() < 0.3
    assert not any(address.startswith("/bunraku/live") for address in reported), "nobody is there"
    assert "/bunraku/1/hand/l_Wrist/qom" in Hand(number=1).at(0.0, 0.0, None)


def test_a_hand_that_shakes_is_indirect_and_sudden() -> None:
    steady, shaking = Hand(), Hand()
    for tick in range(2 * WINDOW):
        one = steady.at(tick * STEP_S, tick * STEP_S, None)
        other = shaking.at(tick * STEP_S, 0.1 * np.sin(25.0 * tick * STEP_S), None)
    for name, least in (("space_effort", 5.0), ("time_effort", 5.0), ("flow_effort", 5.0)):
        address = f"/bunraku/hand/l_Wrist/{name}"
        assert other[address][0] > least * one[address][0]


def test_a_live_dancer_has_a_puppets_features() -> None:
    hand = Hand()
    for tick in range(2 * WINDOW):
        reported = hand.at(tick * STEP_S, 0.0, 0.5 * tick * STEP_S)
    assert reported["/bunraku/live/velocity"] == pytest.approx([0.5, 0.0, 0.0] * JOINTS, abs=1e-3)
    assert reported["/bunraku/live/qom"] == pytest.approx([0.5], abs=1e-3)
    assert reported["/bunraku/live/space_effort"] == pytest.approx([1.0], abs=1e-3)
    assert reported["/mocap/0/qom"] == pytest.approx([0.0])
