"""A camera program's points at the control port: the figure follows, and says what it does not see."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.levers.sources import LIVE
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.point_layouts import LAYOUTS
from appliance.pose.quaternion import Array
from appliance.show_control.figure_pose import FigurePose
from appliance.show_control.live_input import POSITIONS, ROTATIONS
from appliance.show_control.points_input import PointsInput
from tests.pose.landmarks import Landmarks
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, facts, until

PHRASE = read_bvh(files("appliance.show").joinpath("martial_show", "phrase.bvh"))
FIGURE = PHRASE.skeleton
EYES = Landmarks(FIGURE)
LIMBS = (("upper arm", "forearm"), ("forearm", "hand"), ("thigh", "shin"), ("shin", "foot"))
STANDS = FIGURE.standing
MILLIMETRES = 1000.0


@pytest.fixture
def show(folder: Path) -> Iterator[None]:
    with StageDouble(folder, replace(facts(), skeleton=FIGURE, phrases=("main", LIVE))):
        yield


@pytest.fixture
def reader(folder: Path, show: None) -> Iterator[LivePoseReader]:
    with closing(LivePoseReader(folder)) as reader:
        yield reader


def camera(layout: str, pose: Array, root: Sequence[float]) -> list[float]:
    """What a camera 3 m before the dancer sends: Y down, Z away from it, millimetres; 0, 0, 0 for points that
    it does not track.
    """
    seen = EYES.seen(LAYOUTS[layout].parts, pose, np.array(root)) - [0.0, 1.0, 3.0]
    return np.nan_to_num(seen * [MILLIMETRES, -MILLIMETRES, -MILLIMETRES], nan=0.0).ravel().tolist()


def await_pose(asker: Asker, reader: LivePoseReader, points: list[float], name: str = "") -> LivePose:
    """One frame, and the pose that comes of it."""
    found: list[LivePose] = []
    time.sleep(0.005)
    asker.tell(POSITIONS, *([name] if name else []), *points)
    until(lambda: (heard := reader.read()) is not None and not found.append(heard))
    return found[0]


def stand(asker: Asker, reader: LivePoseReader, layout: str, name: str = "") -> LivePose:
    """A dancer stands before the camera for a moment."""
    for _ in range(12):
        heard = await_pose(asker, reader, camera(layout, STANDS, [0.0, 0.9, 0.0]), name)
    return heard


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_figure_follows_the_points_of_each_layout(
    layout: str, reader: LivePoseReader, control: ControlInThread, asker: Asker
) -> None:
    asker.ask("/ping")
    name = "h36m" if layout == "h36m" else ""  # COCO has as many
    stood = stand(asker, reader, layout, name)
    pose = PHRASE.poses[len(PHRASE.poses) // 2].astype(float)
    heard = await_pose(asker, reader, camera(layout, pose, [0.5, 0.9, 0.25]), name)
    assert np.array(heard.root) - stood.root == pytest.approx([0.5, 0.0, 0.25], abs=0.03)
    turned = np.frombuffer(heard.rotations, np.float32).reshape(-1, 4).astype(float)
    turned[np.isnan(turned).any(axis=1)] = quaternion.IDENTITY
    true, _ = FIGURE.forward_kinematics(pose, np.zeros(3))
    fitted, _ = FIGURE.forward_kinematics(turned, np.zeros(3))
    for side in ("left", "right"):
        for start, end in LIMBS:
            first, last = FIGURE.roles[f"{side} {start}"], FIGURE.roles[f"{side} {end}"]
            a, b = true[last] - true[first], fitted[last] - fitted[first]
            assert a @ b / np.linalg.norm(a) / np.linalg.norm(b) > np.cos(np.radians(0.5)), (side, start)
    live = asker.status().live
    assert f"bones of {LAYOUTS[layout].program}'s {len(LAYOUTS[layout].parts)} points" in live


def test_bones_that_a_layout_lacks_stay_with_the_phrase_and_are_named(
    reader: LivePoseReader, control: ControlInThread, asker: Asker
) -> None:
    asker.ask("/ping")
    heard = stand(asker, reader, "coco")
    known = np.isfinite(np.frombuffer(heard.rotations, np.float32).reshape(-1, 4)).all(axis=1)
    bones = FigurePose(FIGURE).joint_of
    assert known[[bones[name] for name in ("Hips", "Chest", "LeftLowerArm", "RightLowerLeg", "Head")]].all()
    assert not known[[bones[name] for name in ("LeftHand", "RightFoot")]].any()
    answer = asker.ask("/phrase", LIVE)[3]
    assert "without LeftHand" in answer and "stay with the phrase" in answer


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([0.0] * 99, "not seen: left shoulder, right shoulder"),
        ([float("nan")] * 99, "not seen: left shoulder, right shoulder"),
        ([1.0] * 99, "in one place"),
        ([1e30] * 99, "not seen"),
        ([1.0] * 98, "98 came"),
        ([1.0] * 33, "or the points of coco"),
        (["mediapipe", *[1.0] * 51], "MediaPipe has 33 points, and 17 came"),
        (["openpose", *[1.0] * 75], "No layout of points is called 'openpose'"),
        (["x\x07" * 4000], "No layout of points"),
    ],
)
def test_points_that_are_no_figure_are_refused_in_words(
    reader: LivePoseReader, control: ControlInThread, asker: Asker, arguments: list[object], message: str
) -> None:
    asker.ask("/ping")
    reply = asker.ask(POSITIONS, *arguments)
    assert reply[2] == 0 and message in reply[3]
    reported = [one for one in asker.ask_all("/fallbacks") if one[1] == "live-refused"]
    assert reported and reported[0][4] == 1
    assert reader.read() is None


def test_a_program_that_also_sends_rotations_of_its_own_joints_is_taken_by_its_points(
    reader: LivePoseReader, control: ControlInThread, asker: Asker
) -> None:
    asker.ask("/ping")
    stand(asker, reader, "zed38")
    asker.tell(ROTATIONS, *[1.0, 0.0, 0.0, 0.0] * 38)
    assert asker.ask("/ping") == ["/pong"]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_whatever_numbers_come_there_is_a_pose_or_a_sentence(layout: str, rng: random.Random) -> None:
    points, now, poses = PointsInput(FIGURE, FigurePose(FIGURE), layout), 0.0, 0
    odd = (0.0, math.nan, math.inf, -math.inf, 1e-300, 1e30, -1e5, 1e5, 1.0)
    for frame in rng.sample(range(len(PHRASE.poses)), 200):
        now += rng.choice((0.0, 0.02, 3.0, -1.0))
        numbers = camera(layout, PHRASE.poses[frame].astype(float), [0.0, 0.9, 0.0])
        for place in rng.sample(range(len(numbers)), rng.choice((0, 3, 10, len(numbers)))):
            numbers[place] = rng.choice(odd)
        if rng.random() < 0.2:
            numbers[rng.randrange(3) :: 3] = [0.0] * (len(numbers) // 3)  # a picture, without depth
        try:
            whole = points.hear(numbers, now)
        except ValueError as error:
            assert "the figure does not follow" in str(error)
            continue
        if whole is not None:
            rotations = np.array(whole[1]).reshape(-1, 4)
            known = np.isfinite(rotations).all(axis=1)
            assert np.isnan(rotations[~known]).all()
            assert np.linalg.norm(rotations[known], axis=1) == pytest.approx(1.0)
            poses += 1
    assert poses


def test_points_that_come_too_fast_cost_nothing_and_a_new_stream_is_measured_anew() -> None:
    points = PointsInput(FIGURE, FigurePose(FIGURE), "kinect")
    large, small = (
        [size * one for one in camera("kinect", STANDS, [1.0, 0.9, 0.0])] for size in (1.0, 0.001)
    )
    first = points.hear(large, 100.0)
    assert first is not None and points.hear(large, 100.001) is None
    again = points.hear(small, 110.0)  # another program, in metres
    assert again is not None and again[0] == pytest.approx(first[0], abs=1e-3)


def test_a_program_that_counts_from_the_hips_makes_the_figure_sink_as_its_knees_bend() -> None:
    points = PointsInput(FIGURE, FigurePose(FIGURE), "mediapipe")
    crouches = STANDS.copy()
    for side in ("left", "right"):
        for role, angle in (("thigh", -1.0), ("shin", 2.0)):
            turn = quaternion.from_axis_angle([1.0, 0.0, 0.0], angle)
            joint = FIGURE.roles[f"{side} {role}"]
            crouches[joint] = quaternion.multiply(crouches[joint], turn)
    parts = LAYOUTS["mediapipe"].parts
    heights = []
    for number, pose in enumerate((*[STANDS] * 12, crouches)):
        seen = EYES.seen(parts, pose, np.zeros(3))
        seen -= 0.5 * (seen[parts.index("left hip")] + seen[parts.index("right hip")])
        whole = points.hear((np.nan_to_num(seen) * [1.0, -1.0, -1.0]).ravel().tolist(), number / 30)
        assert whole is not None
        heights.append(whole[0])
    stands, crouched = heights[-2], heights[-1]
    positions, _ = FIGURE.forward_kinematics(crouches, np.zeros(3))
    legs = -positions[[FIGURE.roles[f"{side} foot"] for side in ("left", "right")], 1].min()
    assert crouched == pytest.approx((0.0, legs, 0.0), abs=0.01) and crouched[1] < stands[1] - 0.1
