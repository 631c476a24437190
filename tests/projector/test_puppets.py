"""Several puppets in one picture: the camera loses none of them, each look draws each where it stands."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.interpolation import TICK_S
from appliance.projector.moment import Moment, PuppetMoment
from appliance.projector.picture.camera import view
from appliance.projector.picture.poses import poses_of, together
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of
from appliance.show.look import STYLES, CameraConfig, LookConfig
from tests.projector.golden_looks import SIZE, renderer
from tests.projector.test_interpolation import SPEED, Ring, following, frame

HEIGHT, SOLE = 1.53, 0.05
AT_S = 17.4


def moved(moment: Moment, x: float, z: float) -> Moment:
    """The same dance with its root there on the stage, metres."""
    (one,) = moment.puppets
    step = (np.array([x, 0.0, z]) - one.positions[0] * [1, 0, 1]).astype(np.float32)
    trail = [(positions + step, world) for positions, world in one.trail]
    return replace(moment, puppets=(replace(one, positions=one.positions + step, trail=trail),))


@pytest.mark.parametrize("aspect", [16 / 9, 9 / 16])
@pytest.mark.parametrize("figures", [2, 4])
def test_the_camera_frames_all_of_them(dance: Recording, aspect: float, figures: int) -> None:
    stands = [(-0.9, 0.0), (0.9, 0.0), (-2.0, -1.5), (2.5, -1.5)][:figures]
    for time_s in (3.0, 17.4, 40.0):
        moments = [moved(moment_of(dance, time_s + place), *at) for place, at in enumerate(stands)]
        poses = together([poses_of(moment, moment.puppets[0], HEIGHT, SOLE) for moment in moments])
        for camera in (CameraConfig(), CameraConfig(move="orbit", figure=0.9, period_s=10.0)):
            seen = view(camera, camera, 1.0, time_s, poses, aspect)
            joints = np.concatenate([poses.positions[0], np.ones((poses.positions.shape[1], 1))], axis=1)
            clip = joints @ seen.projection.T
            assert (clip[:, 3] > 0).all() and np.abs(clip[:, :2] / clip[:, 3:]).max() < 0.97


@pytest.mark.parametrize("style", STYLES)
def test_each_look_draws_each_of_them_where_it_stands(
    style: str, dance: Recording, gl: moderngl.Context
) -> None:
    still = {"move": "still", "figure": 0.3, "angle_deg": 0.0}
    look = LookConfig.model_validate(
        {"name": "it", "style": style, "camera": still, "held": {"strength": 1.0}}
    )
    holds = np.zeros(len(dance.skeleton), np.float32)
    holds[dance.skeleton.index("chest")] = 1.0
    left, right = (moved(moment_of(dance, AT_S), x, 0.0) for x in (-1.1, 1.1))
    with renderer(gl, dance.skeleton, {"it": look}) as made:
        free, of_left, of_right = (
            picture(gl, made, replace(left, puppets=(holding(left, first), holding(right, second))))
            for first, second in ((None, None), (holds, None), (None, holds))
        )
    half = SIZE[0] // 2
    for held, own, other in (
        (of_left, np.s_[:, :half], np.s_[:, half:]),
        (of_right, np.s_[:, half:], np.s_[:, :half]),
    ):
        assert np.abs(held - free)[own].max() > 25
        assert np.abs(held - free)[other].max() < 8  # what the far glow spills


def test_all_of_them_are_interpolated_to_one_time() -> None:
    frames = []
    for tick in range(10):
        seen = frame(tick, 10.0 + tick * TICK_S, 10.004 + tick * TICK_S)
        (one,) = seen.puppets
        other = replace(one, positions=one.positions + np.float32(1.0), holds=one.holds * 0.5)
        frames.append(replace(seen, puppets=(one, other)))
    poses = following(Ring(frames))
    poses.take(10.2)
    moment = poses.moment(10.13)
    assert moment is not None
    one, other = moment.puppets
    assert other.positions == pytest.approx(one.positions + 1.0)
    assert other.holds == pytest.approx(0.5 * np.asarray(one.holds))
    assert one.positions[0, 0] == pytest.approx(SPEED * (10.0 + moment.time_s), rel=1e-5)
    assert len(other.trail) == len(one.trail) == len(moment.trail_times)


def holding(moment: Moment, holds: np.ndarray | None) -> PuppetMoment:
    return replace(moment.puppets[0], holds=holds)


def picture(gl: moderngl.Context, made: Renderer, moment: Moment) -> np.ndarray:
    return draw_still(gl, made, moment, "it", SIZE).astype(int)
