"""Springs as a puppeteer: where they draw the joints, what moves them, and what they bear."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.dancer.forward_kinematics import Figure
from appliance.dancer.hands import Hands
from appliance.dancer.puppeteers import FixedOrientation, Puppeteer, WornSensor
from appliance.dancer.springs import Springs
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path
from appliance.show.springs import RegionConfig, SpringsConfig, springs_by_name
from tests.bundles import FIGURE, MOVING

TICK_S = 0.02
REST = np.tile(quaternion.IDENTITY, (len(FIGURE), 1))
ROOT = np.array([0.0, 0.95, 0.0], np.float32)


def region(stiffness: float, damping: float = 2.0) -> dict[str, RegionConfig]:
    one = RegionConfig(directional_stiffness=stiffness, damping=damping)
    return dict.fromkeys(("trunk", "head", "arms", "legs"), one)


SETTINGS = {
    one.name: one
    for one in (
        SpringsConfig(name="calm", **region(60.0)),
        SpringsConfig(name="heavy", **region(0.5), gravity=9.81),
        SpringsConfig(name="windy", **region(5.0), wind=(0.0, 0.0, 6.0), air=5.0),
        SpringsConfig(name="kicked", **region(60.0), kick=(0.0, 0.0, 2.0)),
        SpringsConfig(name="stirred", **region(5.0), air=5.0, stir=1.0),
        SpringsConfig(name="blown up", **region(60.0), air=0.0),
    )
}


class Dance:
    """A phrase that stands, springs on it, and a puppet that copies its targets."""

    def __init__(
        self, setting: str = "calm", others: tuple[Puppeteer, ...] = (), joint: str = "Chest"
    ) -> None:
        self.figure = Figure(FIGURE)
        self.figure.set_pose(REST, ROOT)
        self.springs = Springs(joint, FIGURE, self.figure, MOVING, SETTINGS, setting, 1.0, others)
        self.hands = Hands([*others, self.springs], MOVING)
        self.pose, self.root, self.now = REST.copy(), ROOT.copy(), 0.0

    def tick(self, count: int = 1) -> np.ndarray:
        """Local orientations (count, M, 4) that the springs ask for."""
        window = np.tile(self.pose[[FIGURE.index(name) for name in MOVING]], (8, 1, 1))
        found = []
        for _ in range(count):
            self.now += TICK_S
            self.springs.follow_phrase(self.pose, self.root)
            self.hands.pull(self.now, window)
            found.append(self.hands.targets[0].copy())
        return np.array(found)

    def bone(self, targets: np.ndarray, joint: str) -> np.ndarray:
        """Where the bone below a joint points when the body takes the targets, (3,)."""
        pose = self.pose.copy()
        for name in self.springs.joints:
            pose[FIGURE.index(name)] = targets[MOVING.index(name)]
        positions, _ = FIGURE.forward_kinematics(pose.astype(float), self.root.astype(float))
        child = FIGURE.parents.index(FIGURE.index(joint))
        away = positions[child] - positions[FIGURE.index(joint)]
        return away / np.linalg.norm(away)


def test_at_rest_they_leave_the_phrase_as_it_is() -> None:
    dance = Dance()
    assert dance.springs.joints == ("Chest", "lShldr")  # the forearm has no bone below it that could turn
    targets = dance.tick(100)
    assert quaternion.angle_between(targets, np.broadcast_to(REST[0], targets.shape)).max() < 1e-3
    assert dance.hands.weights[MOVING.index("lShldr")] == pytest.approx(1.0)
    assert dance.hands.weights[MOVING.index("lThigh")] == 0.0  # not below the chest


def test_gravity_lets_an_arm_hang() -> None:
    dance = Dance("heavy")
    arm = dance.bone(dance.tick(400)[-1], "lShldr")
    assert arm[1] < -0.98


def test_wind_blows_the_arm_along() -> None:
    dance = Dance("windy")
    assert dance.bone(dance.tick(400)[-1], "lShldr")[2] > 0.5


def test_a_kick_swings_the_body_and_it_comes_to_rest_again() -> None:
    dance = Dance()
    dance.tick(20)
    dance.springs.kick((0.0, 0.0, 2.0))
    course = dance.tick(400)
    turned = quaternion.angle_between(course[:, MOVING.index("lShldr")], REST[0])
    assert turned[:50].max() > 0.15 and turned[-1] < 0.01


def test_a_mass_that_flies_past_the_opposite_does_not_turn_its_joint_over() -> None:
    dance, rng = Dance("heavy"), np.random.default_rng(3)
    course = []
    for _ in range(60):
        dance.springs.kick(rng.uniform(-3.0, 3.0, 3).tolist())
        course.append(dance.tick(20))
    turned = np.concatenate(course)[:, MOVING.index("Chest")]
    assert quaternion.angle_between(turned, REST[0]).max() < np.radians(91)
    assert quaternion.angle_between(turned[1:], turned[:-1]).max() < np.radians(45)


def test_a_setting_brings_its_kick_once() -> None:
    dance = Dance()
    dance.tick(20)
    still = dance.springs.energy()
    dance.springs.call("kicked")
    assert dance.springs.energy() > still + 1.0
    restore(dance.springs, packed(dance.springs))
    kicked = dance.springs.energy()
    restore(dance.springs, packed(dance.springs))
    assert dance.springs.energy() == kicked


def test_a_hand_keeps_its_joint_and_its_turning_stirs_the_air() -> None:
    hand = WornSensor("lForeArm")
    dance = Dance("stirred", (hand,))
    assert "lForeArm" not in dance.springs.joints
    for still in (True, False):
        for tick in range(100):
            angle = 0.0 if still else 0.2 * tick
            reading = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)
            hand.take_reading(reading.tolist(), dance.now + TICK_S)
            targets = dance.tick()
        turned = float(quaternion.angle_between(targets[0, MOVING.index("lShldr")], REST[0]))
        assert turned < 0.01 if still else turned > 0.1


def test_joints_below_turn_with_a_joint_that_another_hand_holds() -> None:
    held = FixedOrientation("lShldr", (1.0, 0.0, 0.0, 0.0))
    dance = Dance("windy", (held,), joint="Hips")
    assert dance.springs.joints == ("Hips", "Chest")
    targets = dance.tick(300)
    assert np.isfinite(targets).all()


def test_a_phrase_that_jumps_carries_them_along() -> None:
    dance = Dance()
    dance.tick(50)
    dance.root += np.array([3.0, 0.0, -2.0], np.float32)
    targets = dance.tick(5)
    assert quaternion.angle_between(targets, np.broadcast_to(REST[0], targets.shape)).max() < 1e-3


def test_a_phrase_that_starts_to_move_is_followed_late() -> None:
    dance = Dance()
    dance.tick(50)
    course = []
    for _ in range(25):
        dance.root += np.array([0.0, 0.0, 0.04], np.float32)  # 2 m/s
        course.append(dance.bone(dance.tick()[0], "lShldr")[2])
    assert min(course) < -0.03


def test_springs_that_do_not_hold_rest_and_begin_at_the_phrase() -> None:
    dance = Dance("heavy")
    dance.springs.enabled = False
    dance.tick(200)
    assert dance.springs.energy() == 0.0
    dance.springs.enabled = True
    first = dance.tick()[0]
    assert quaternion.angle_between(first, np.broadcast_to(REST[0], first.shape)).max() < 0.01


def test_they_go_on_from_their_state_bit_for_bit() -> None:
    one, other = Dance("windy"), Dance("calm")
    one.springs.kick((1.0, -2.0, 3.0))
    one.tick(30)
    one.springs.turn("wind", (1.0, 2.0, 3.0), 1.0)
    one.springs.turn("feedback", (1.0,))
    restore(other.hands, packed(one.hands))
    other.now = one.now
    assert np.array_equal(one.tick(50), other.tick(50))


def test_whatever_the_numbers_are_targets_stay_orientations(rng: Random) -> None:
    def drawn() -> RegionConfig:
        return RegionConfig(
            mass=rng.choice((0.05, 1.0, 50.0)),
            stiffness=rng.choice((0.0, 5000.0, 1e6)),
            directional_stiffness=rng.choice((0.0, 60.0, 1e5)),
            damping=rng.choice((0.0, 60.0)),
        )

    for _ in range(10):
        setting = SpringsConfig(
            name="drawn",
            **{name: drawn() for name in ("trunk", "head", "arms", "legs")},
            gravity=rng.choice((-20.0, 20.0)),
            wind=(30.0, -30.0, 30.0),
            gusts=1.0,
            air=rng.choice((0.0, 20.0)),
            stir=4.0,
            follow=1.0,
        )
        dance = Dance(joint="Hips")
        dance.springs.settings = SETTINGS | {"drawn": setting}
        dance.springs.call("drawn")
        noise = np.random.default_rng(rng.randrange(1 << 30))
        for _ in range(100):
            dance.pose = quaternion.normalize(noise.normal(size=REST.shape)).astype(np.float32)
            dance.root = noise.normal(size=3).astype(np.float32)
            dance.figure.set_pose(dance.pose, dance.root)
            dance.springs.kick(noise.normal(size=3) * 50)
            targets = dance.tick()[0]
        assert np.allclose(np.linalg.norm(targets, axis=-1), 1.0, atol=1e-3)
        assert dance.springs.energy() < 1e7


def test_a_joint_without_bones_below_is_refused_in_words() -> None:
    figure = Figure(FIGURE)
    with pytest.raises(ValueError, match=r"No springs can hang from 'lForeArm'.*further up"):
        Springs("lForeArm", FIGURE, figure, MOVING, SETTINGS, "calm")


def test_a_bone_has_the_springs_of_the_joint_that_turns_it() -> None:
    skeleton = read_bvh(default_show_path() / "skeleton.bvh").skeleton
    moving = ("hip", "chest", "neck", "head", "rShldr", "rForeArm", "lThigh", "lShin", "lFoot")
    springs = Springs("hip", skeleton, Figure(skeleton), moving, SETTINGS, "calm")
    names = [name for name in skeleton.names if name in moving]
    assert dict(zip(names, springs.regions, strict=True)) == {
        "hip": ("trunk", "trunk"),
        "chest": ("trunk", "trunk"),
        "neck": ("head", "trunk"),
        "head": ("head", "head"),
        "rShldr": ("arms", "trunk"),  # the mass is the arm's; the chest turns the bone
        "rForeArm": ("arms", "arms"),
        "lThigh": ("legs", "trunk"),
        "lShin": ("legs", "legs"),
        "lFoot": ("legs", "legs"),
    }


def test_the_built_in_settings() -> None:
    assert list(springs_by_name([])) == ["loose", "stiff", "storm"]
    own = SpringsConfig(name="own")
    assert springs_by_name([own]) == {"own": own}
