"""Outlines: samples let them move smoothly; a machine draws them as finely as it has time for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.loop import affordable_detail
from appliance.projector.moment import Moment
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.wall import DETAILS, FLAT, Detail, Wall
from appliance.projector.still import moment_of
from appliance.show.look import CameraConfig, LookConfig
from tests.projector.golden_looks import AT_S, SIZE, renderer

STEPS = 8  # of a way of one pixel
PIXEL_M = 0.0135  # that is one pixel of these pictures
CAMERA = CameraConfig(move="still", angle_deg=0.0, follow=0.0)
PERIOD_S = 1 / 60


def moved(moment: Moment, right_m: float) -> Moment:
    """The same moment a little further right, trail and all."""
    way = np.float32([right_m, 0.0, 0.0])
    (one,) = moment.puppets
    trail = [(positions + way, world) for positions, world in one.trail]
    return replace(moment, puppets=(replace(one, positions=one.positions + way, trail=trail),))


@pytest.fixture(scope="module")
def plain(gl: moderngl.Context, dance: Recording) -> Iterator[Renderer]:
    looks = {
        style: LookConfig(name=style, style=style, camera=CAMERA, trail_s=0.0) for style in ("plaster", "ink")
    }
    with renderer(gl, dance.skeleton, looks) as made:
        yield made


def pictures(gl: moderngl.Context, made: Renderer, dance: Recording, look: str, detail: Detail) -> np.ndarray:
    """(STEPS + 1, height, width) while the figure moves by a pixel."""
    target = gl.framebuffer([gl.texture(SIZE, 4)])
    found = []
    for step in range(STEPS + 1):
        target.clear()
        moment = moved(moment_of(dance, AT_S), PIXEL_M * step / STEPS)
        made.draw(moment, look, look, 1.0, Wall(target, SIZE, SIZE, FLAT, detail=detail))
        found.append(np.frombuffer(target.read(components=4), np.uint8).reshape(SIZE[1], SIZE[0], 4)[..., :3])
    target.release()
    return np.array(found, float).mean(axis=-1)


def twinkling(sequence: np.ndarray) -> float:
    """How much of its whole change a pixel of the outline makes in one step of eight: 1 is a stair."""
    whole = np.ptp(sequence, axis=0)
    step = np.abs(np.diff(sequence, axis=0)).max(axis=0)
    return float((step / np.maximum(whole, 1.0))[whole > 60].mean())


@pytest.mark.parametrize("look", ["plaster", "ink"])
def test_an_outline_with_samples_moves_smoothly(
    look: str, gl: moderngl.Context, plain: Renderer, dance: Recording
) -> None:
    coarse, whole, sampled = (twinkling(pictures(gl, plain, dance, look, detail)) for detail in DETAILS)
    assert sampled < 0.8 * min(coarse, whole), (coarse, whole, sampled)
    assert sampled < 0.55


def test_a_look_that_says_its_scale_keeps_it(gl: moderngl.Context, dance: Recording) -> None:
    soft = {"soft": LookConfig(name="soft", render_scale=0.25, camera=CAMERA)}
    with renderer(gl, dance.skeleton, soft) as made:
        first, second = (pictures(gl, made, dance, "soft", detail)[0] for detail in DETAILS[:2])
    assert np.array_equal(first, second)


class Chip:
    """Draws in the time that each detail takes, on a fake clock."""

    def __init__(self, *times_s: float) -> None:
        self._times_s = dict(zip(DETAILS, times_s, strict=True))
        self.now = 5.0
        self.drawn: list[Detail] = []

    def draw(self, detail: Detail) -> None:
        first = detail not in self.drawn
        self.drawn.append(detail)
        self.now += self._times_s[detail] + (0.5 if first else 0.0)  # a driver's work at the first use

    def clock(self) -> float:
        return self.now


def test_the_finest_that_leaves_time_is_taken() -> None:
    for times, best in (
        ((0.001, 0.0012, 0.002), 2),
        ((0.003, 0.006, 0.012), 1),
        ((0.007, 0.009, 0.010), 0),
        ((0.050, 0.060, 0.100), 0),
    ):
        chip = Chip(*times)
        assert affordable_detail(chip.draw, PERIOD_S, chip.clock) == DETAILS[best]
    assert chip.drawn == [DETAILS[0]] * 3, "a slow one is not kept waiting by what it cannot draw anyway"
