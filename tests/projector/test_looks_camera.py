"""The camera never loses the dancer, moves softly, and is where its time says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.moment import Moment
from appliance.projector.picture.camera import CuedCamera, View, Ways, view
from appliance.projector.picture.poses import poses_of
from appliance.projector.still import moment_of
from appliance.show.look import CameraConfig

HEIGHT, SOLE = 1.53, 0.05
ASPECTS = (16 / 9, 4 / 3, 9 / 16)


def seen(moment: Moment, config: CameraConfig, aspect: float) -> tuple[View, np.ndarray]:
    """The view of a moment and where its joints are in the picture, -1 to 1."""
    poses = poses_of(moment, moment.puppets[0], HEIGHT, SOLE)
    at = view(config, config, 1.0, moment.time_s, poses, aspect)
    joints = np.concatenate([poses.positions[0], np.ones((poses.positions.shape[1], 1))], axis=1)
    clip = joints @ at.projection.T
    assert (clip[:, 3] > 0).all()
    return at, clip[:, :2] / clip[:, 3:]


def with_puppet(moment: Moment, **changes: Any) -> Moment:
    return replace(moment, puppets=(replace(moment.puppets[0], **changes),))


def travelled(moment: Moment, metres: float) -> Moment:
    """The same moment on its way across the stage at 4 m/s."""
    way = [(metres - 4.0 * (moment.time_s - time)) * np.array([1.0, 0.0, 0.3]) for time in moment.trail_times]
    trail = [
        ((positions + step).astype(np.float32), world)
        for step, (positions, world) in zip(way, moment.puppets[0].trail, strict=True)
    ]
    return with_puppet(moment, positions=trail[-1][0], trail=trail)


@pytest.mark.parametrize("aspect", ASPECTS)
@pytest.mark.parametrize(
    "config",
    [
        CameraConfig(),
        CameraConfig(follow=0.0, figure=0.9),
        CameraConfig(follow=1.0, move="orbit", lens_deg=75.0, period_s=10.0),
        CameraConfig(move="still", angle_deg=-180.0, elevation_deg=70.0),
    ],
    ids=["built in", "does not follow", "orbits", "from above"],
)
def test_no_joint_leaves_the_picture(dance: Recording, config: CameraConfig, aspect: float) -> None:
    for time_s in np.arange(1.5, dance.seconds, 3.7):
        moment = moment_of(dance, float(time_s))
        for stage in (moment, travelled(moment, 3.0), travelled(moment, -12.0)):
            _, joints = seen(stage, config, aspect)
            assert np.abs(joints).max() < 0.97


@pytest.mark.parametrize("metres", [0.0, 36.0])
@pytest.mark.parametrize("lens_deg", [10.0, 15.0, 30.0])
def test_no_joint_is_too_far_away_to_be_drawn(dance: Recording, lens_deg: float, metres: float) -> None:
    """A small figure through a long lens, and one that goes to the end of a wide stage."""
    config = CameraConfig(lens_deg=lens_deg, figure=0.1, follow=0.0)
    moment = travelled(moment_of(dance, 3.0), metres)
    poses = poses_of(moment, moment.puppets[0], HEIGHT, SOLE)
    at = view(config, config, 1.0, moment.time_s, poses, 16 / 9)
    clip = np.insert(poses.positions[0].astype(float), 3, 1.0, axis=1) @ at.projection.T
    assert (np.abs(clip[:, 2]) < clip[:, 3]).all()


@pytest.mark.parametrize(
    ("aspect", "in_middle", "sizes"), [(16 / 9, 1.0, 1.2), (4 / 3, 1.0, 1.2), (9 / 16, 0.95, 1.4)]
)
def test_figure_stays_in_the_middle_third_and_of_one_size(
    dance: Recording, aspect: float, in_middle: float, sizes: float
) -> None:
    """Share of pictures with the middle of the joints in the middle third both ways; largest to smallest size
    of a standing figure. A camera that lets the dancer travel does worse, so the limits can be missed."""

    def framed(config: CameraConfig) -> tuple[float, float]:
        middles, heights = [], []
        for time_s in np.arange(1.5, dance.seconds, 0.5):
            moment = moment_of(dance, float(time_s))
            at, joints = seen(moment, config, aspect)
            middles.append(0.5 * (joints.min(axis=0) + joints.max(axis=0)))
            root = np.append(moment.puppets[0].positions[0] / HEIGHT, 1.0)
            heights.append(1.0 / float((at.projection @ root)[3]))
        return float((np.abs(middles) < 1 / 3).all(axis=1).mean()), max(heights) / min(heights)

    share, ratio = framed(CameraConfig())
    assert share >= in_middle and ratio < sizes
    travelling = framed(CameraConfig(follow=0.0))
    assert travelling[0] < in_middle and travelling[1] > sizes


def test_a_jump_of_the_phrase_is_still_in_the_picture(dance: Recording) -> None:
    """Where a phrase starts over the dancer is elsewhere from one tick to the next."""
    moment = moment_of(dance, 20.0)
    far = (moment.puppets[0].positions + np.float32([3.0, 0.0, -2.0])).astype(np.float32)
    jumped = with_puppet(moment, positions=far)
    assert np.abs(seen(jumped, CameraConfig(), 16 / 9)[1]).max() < 1.0


def test_moves_softly(dance: Recording) -> None:
    """From one display frame to the next the camera goes less than two thousandths of the figure's height."""
    eyes = [
        seen(moment_of(dance, 15.0 + tick / 50), CameraConfig(figure=0.5), 16 / 9)[0].eye
        for tick in range(150)
    ]
    steps = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
    jolts = np.linalg.norm(np.diff(eyes, n=2, axis=0), axis=1)
    assert steps.max() < 0.03 and jolts.max() < 0.003


def test_stands_where_its_time_says(dance: Recording) -> None:
    poses = poses_of(moment_of(dance, 20.0), moment_of(dance, 20.0).puppets[0], HEIGHT, SOLE)
    orbit = CameraConfig(move="orbit", angle_deg=0.0, period_s=40.0)
    angles = [np.degrees(view(orbit, orbit, 1.0, at, poses, 1.5).azimuth) for at in (0.0, 10.0, 40.0)]
    assert angles == pytest.approx([0.0, 90.0, 360.0])
    still = CameraConfig(move="still", angle_deg=90.0)
    assert view(still, still, 1.0, 7.0, poses, 1.5).back[0] > 0.9


def test_fades_from_place_to_place_the_short_way(dance: Recording) -> None:
    poses = poses_of(moment_of(dance, 20.0), moment_of(dance, 20.0).puppets[0], HEIGHT, SOLE)
    before, now = CameraConfig(move="still", angle_deg=170.0), CameraConfig(move="still", angle_deg=-170.0)
    ends = [np.degrees(view(before, now, mix, 0.0, poses, 1.5).azimuth) for mix in (0.0, 0.5, 1.0)]
    assert ends == pytest.approx([170.0, 180.0, 190.0])


@pytest.mark.parametrize("by_cue", [False, True])
def test_a_circling_camera_fades_without_a_jump_to_its_other_side(dance: Recording, by_cue: bool) -> None:
    """Where the two places come to lie opposite each other in mid-fade, the other way round gets shorter."""
    poses = poses_of(moment_of(dance, 20.0), moment_of(dance, 20.0).puppets[0], HEIGHT, SOLE)
    orbit, still = CameraConfig(move="orbit", period_s=20.0), CameraConfig(move="still")
    for begins_s in range(20):
        ways, backs = Ways(), []
        for mix in np.linspace(0.0, 1.0, 8 * 60 + 1).tolist():
            time_s = begins_s + 8.0 * mix
            if by_cue:
                cued = CuedCamera({}, {"move": "still"}, mix)
                backs.append(view(orbit, orbit, 1.0, time_s, poses, 1.5, cued, ways).back)
            else:
                backs.append(view(orbit, still, mix, time_s, poses, 1.5, ways=ways).back)
        assert np.linalg.norm(np.diff(backs, axis=0), axis=1).max() < 0.05


def test_a_fade_that_takes_over_from_another_goes_the_short_way() -> None:
    ways = Ways()
    assert ways("look", 3.0, 0.5) == pytest.approx(3.0)
    assert ways("look", 3.3, 0.6) == pytest.approx(3.3)  # the long way now, without a jump
    assert ways("look", -0.2, 0.1) == pytest.approx(-0.2)


def test_a_cue_moves_the_camera_whatever_the_look(dance: Recording) -> None:
    """Softly from the looks' own place, also while the look changes; what a cue leaves out stays."""
    poses = poses_of(moment_of(dance, 20.0), moment_of(dance, 20.0).puppets[0], HEIGHT, SOLE)
    before, now = CameraConfig(move="still", angle_deg=10.0), CameraConfig(move="still", angle_deg=50.0)
    turns = []
    for mix in (0.0, 0.5, 1.0):
        cued = CuedCamera({}, {"angle_deg": 90.0, "elevation_deg": 40.0}, mix)
        turns.append(view(before, now, 0.5, 0.0, poses, 1.5, cued))
    assert np.degrees([turn.azimuth for turn in turns]) == pytest.approx([30.0, 60.0, 90.0])
    assert np.degrees(np.arcsin([turn.back[1] for turn in turns])) == pytest.approx([7.0, 23.5, 40.0])
    far = view(now, now, 1.0, 0.0, poses, 1.5, CuedCamera({"figure": 0.2}, {"figure": 0.2}, 1.0))
    near = view(now, now, 1.0, 0.0, poses, 1.5)
    assert np.linalg.norm(far.eye) > 2.5 * np.linalg.norm(near.eye)
