"""Light that an audience can read: each lamp follows a limb, slowly enough, and heads do not tremble."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.levers.show_state import ShowState
from appliance.lights.dance import MOST_ON_S, Dance
from appliance.lights.patch import Patch
from appliance.lights.rig import Rig
from appliance.lights.usual_mapping import usual_mapping, with_usual_mapping
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.release.choice import EMBEDDED_SHOW
from appliance.show.light_rules import USUAL_ATTACK_S, USUAL_RELEASE_S
from appliance.show.lights import LightsConfig
from appliance.show.show import load_show
from tests.lights.rigs import frame, lights, rig

PAR = {"name": "par", "profile": "led-par", "address": 1}
HEAD = {"name": "head", "profile": "moving-wash", "address": 21, "place": [2.0, 4.0, 1.0]}


def rig_of(*places: float) -> LightsConfig:
    """Pars at these x, metres; and a head on the dancer's left."""
    pars = [
        {"name": f"par {n}", "profile": "led-par", "address": 40 + 10 * n, "place": [x, 4.0, 0.0]}
        for n, x in enumerate(places)
    ]
    return LightsConfig.model_validate({"fixtures": [*pars, HEAD]})


def test_lamps_follow_the_limbs_of_their_side() -> None:
    config, skeleton = rig_of(-1.0, -2.0, 1.0, 0.0), load_show(EMBEDDED_SHOW).skeleton
    mapping = usual_mapping(config.fixtures, Patch(config.fixtures, EMBEDDED_SHOW), skeleton)
    accents = {rule.fixtures[0]: rule.joint for rule in mapping.rules if rule.reads == "speed"}
    assert accents["par 0"] == "rHand" and accents["par 1"] == "rFoot" and accents["par 2"] == "lHand"
    assert accents["par 3"] == "chest"
    assert [rule.joint for rule in mapping.rules if rule.drives == "aim"] == ["lFoot"]
    assert {rule.reads for rule in mapping.rules if rule.drives == "colour"} == {"answer"}


def test_lamps_from_the_front_from_the_sides_and_from_behind_have_colours_of_their_own() -> None:
    """From the front it stays light enough to see a face; a lamp on the floor is an accent."""
    depths = {"front": (4.0, 2.0), "low": (0.3, 2.0), "side": (4.0, 0.0), "back": (4.0, -2.0)}
    fixtures = [
        {"name": name, "profile": "led-par", "address": 10 * n + 1, "place": [1.0, *place]}
        for n, (name, place) in enumerate(depths.items())
    ]
    config, skeleton = LightsConfig.model_validate({"fixtures": fixtures}), load_show(EMBEDDED_SHOW).skeleton
    mapping = usual_mapping(config.fixtures, Patch(config.fixtures, EMBEDDED_SHOW), skeleton)
    ranges = {
        name: rule.colours for rule in mapping.rules for name in rule.fixtures if rule.drives == "colour"
    }
    assert ranges["low"] == ranges["side"] and len({str(one) for one in ranges.values()}) == 3
    assert all(min(colour) > 0.3 for colour in ranges["front"])
    assert all(min(colour) < 0.4 for colour in ranges["back"])


def test_a_rig_with_rules_of_its_own_keeps_them() -> None:
    own = lights([PAR], {"reads": "steady", "drives": "dimmer"})
    skeleton = load_show(EMBEDDED_SHOW).skeleton
    assert with_usual_mapping(own, Patch(own.fixtures, EMBEDDED_SHOW), skeleton) is own


def test_light_rises_and_falls_no_faster_than_eyes_like() -> None:
    made = rig(lights([PAR], {"reads": "height", "joint": "hand", "drives": "dimmer"}))
    shown = []
    for tick in range(1, 200):
        seen = frame(tick, (0.0, 2.0 * (tick % 60 < 30), 0.0))
        shown.append(made.render(seen, 1, ShowState(), seen.frame_time)[1][0])
    steps = np.diff(np.array(shown, int))
    assert steps.max() <= 255 * 0.02 / USUAL_ATTACK_S + 1
    assert -steps.min() <= 255 * 0.02 / USUAL_RELEASE_S + 1
    assert max(shown) > 250


def test_the_answer_counts_joints_that_no_hand_holds() -> None:
    dance = Dance(Skeleton(("hip", "arm", "leg"), (-1, 0, 0), np.zeros((3, 3))))
    turned = quaternion.from_axis_angle([1, 0, 0], np.radians([0.0, 40.0, 10.0])).astype(np.float32)

    def answer(holds: float, first: int) -> float:
        puppet = PuppetFrame.of(3)
        puppet.pose[:], puppet.holds[1] = turned, holds
        for tick in range(first, first + 60):
            dance.take_frame(JointFrame((puppet,), tick, tick * 0.02), puppet, 1, tick * 0.02)
        return dance.answer

    assert answer(1.0, 1) == pytest.approx(10.0, abs=0.1)  # the leg's, not that of the arm in the hand
    assert answer(0.0, 100) == pytest.approx(0.0, abs=0.1)  # a phrase that no hand holds answers nobody


def test_between_frames_places_move_on_so_that_heads_do_not_tremble() -> None:
    """The tilt of a head that follows an even motion, in passes at 40 Hz over frames at 50 Hz."""
    made = rig(lights([HEAD], {"reads": "place", "joint": "hand", "drives": "aim"}))
    angles, latency_s = [], 0.003
    for place in range(80):
        now = place * 0.025 + 0.0101
        tick = int((now - latency_s) / 0.02)
        seen = frame(tick + 1, (0.0, 0.5 + 0.02 * tick, 0.0))
        seen.frame_time = seen.left = tick * 0.02
        made.render(seen, 1, ShowState(), now)
        angles.append(made.patch.heads.angles.copy())
    second = np.abs(np.diff(np.array(angles)[40:], n=2, axis=0)).max()
    first = np.abs(np.diff(np.array(angles)[40:], axis=0)).max()
    assert first > 0.1
    assert second < 0.15 * first  # 0.8 with the newest frame as it is


def test_a_stage_that_hangs_leaves_places_where_they_are() -> None:
    made = rig(lights([HEAD], {"reads": "place", "joint": "hand", "drives": "aim"}))
    for tick in range(1, 100):
        last = frame(tick, (0.0, 0.5 + 0.01 * tick, 0.0))
        made.render(last, 1, ShowState(), last.frame_time)
    shown = []
    for late_s in (0.0, MOST_ON_S, 0.5, 1.0):
        made.render(last, 1, ShowState(), last.frame_time + late_s)
        shown.append(float(made.dances.of(None).place("hand")[1]))
    assert shown[1] - shown[0] < 0.02
    assert shown[3] == pytest.approx(shown[0])


@pytest.mark.parametrize(
    ("place", "joint", "is_lowered"),
    [
        ((0.0, 4.0, 4.0), "head", True),  # from the front, into the face
        ((0.0, 4.0, -4.0), "head", False),  # from behind
        ((0.0, 4.0, 4.0), "lFoot", False),  # far below the eyes
        ((5.0, 1.6, 0.0), "head", False),  # from the side
    ],
)
def test_a_beam_from_the_front_passes_below_the_dancers_eyes(
    place: tuple[float, float, float], joint: str, is_lowered: bool
) -> None:
    skeleton = load_show(EMBEDDED_SHOW).skeleton
    head = {**HEAD, "place": list(place)}
    config = LightsConfig.model_validate(
        {
            "fixtures": [head],
            "mappings": [{"name": "one", "rules": [{"reads": "place", "joint": joint, "drives": "aim"}]}],
        },
        context={"joints": skeleton.names},
    )
    made = Rig(config, Patch(config.fixtures, None), skeleton)
    made.safety = 0.0
    puppet = PuppetFrame.of(len(skeleton))
    positions, world = skeleton.forward_kinematics(skeleton.standing, np.array([0.0, 1.0, 0.0]))
    puppet.positions[:], puppet.world[:] = positions, world
    for tick in range(200):
        made.render(JointFrame((puppet,), tick, tick * 0.02), 1, ShowState(), tick * 0.02)
    eyes = made.dances.of(None).eyes
    assert eyes is not None and eyes[1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    beam, to_eyes = made.patch.heads.beams()[0], eyes[0] - np.array(place)
    passes = np.linalg.norm(np.cross(to_eyes, beam))
    aimed = np.linalg.norm(np.cross(positions[skeleton.index(joint)] - np.array(place), beam))
    assert (aimed > 0.1) == is_lowered
    if is_lowered:
        assert passes > 0.2


def test_the_dancers_eyes_are_found_once_a_pass() -> None:
    """However many heads aim: each asks for them."""
    skeleton = load_show(EMBEDDED_SHOW).skeleton
    dance, puppet = Dance(skeleton), PuppetFrame.of(len(skeleton))
    seen = []
    for tick in range(3):
        puppet.positions[:] = float(tick)
        dance.take_frame(JointFrame((puppet,), tick, tick * 0.02), puppet, 1, tick * 0.02)
        seen.append(dance.eyes)
        assert dance.eyes is seen[-1]
    heights = [eyes[0][1] for eyes in seen if eyes is not None]
    assert len(heights) == 3 and np.all(np.diff(heights) > 0.5)
