"""The mark of held joints: every look shows which limb a hand holds, and how firmly."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of
from appliance.show.look import STYLES, HeldConfig, LookConfig
from tests.projector.golden_looks import AT_S, SIZE, renderer

ARM = "lShldr"


def held(dance: Recording, weight: float, joint: str = ARM) -> np.ndarray:
    holds = np.zeros(len(dance.skeleton), np.float32)
    holds[dance.skeleton.index(joint)] = weight
    return holds


def redness(picture: np.ndarray) -> np.ndarray:
    """(H, W) how much more red than blue each pixel is."""
    return np.asarray(picture[..., 0].astype(int) - picture[..., 2])


@pytest.mark.parametrize("style", [style for style in STYLES if style != "strings"])  # all limbs glow there
def test_the_held_limb_changes_colour_with_the_weight_and_nothing_else_does(
    style: str, dance: Recording, gl: moderngl.Context, looks: Renderer
) -> None:
    free, half, whole = (
        draw_still(gl, looks, moment_of(dance, AT_S, held(dance, weight)), style, SIZE)
        for weight in (0.0, 0.5, 1.0)
    )
    assert np.array_equal(free, draw_still(gl, looks, moment_of(dance, AT_S), style, SIZE))
    gained = redness(whole) - redness(free)
    marked = gained > 60
    assert 40 < marked.sum() < 0.012 * SIZE[0] * SIZE[1], "an upper arm's worth of pixels"
    rows, columns = np.nonzero(marked)
    assert np.ptp(rows) < 45 and np.ptp(columns) < 45, "in one place"
    grown = redness(half)[marked] - redness(free)[marked]
    assert 0.2 * gained[marked].mean() < grown.mean() < 0.95 * gained[marked].mean()


def test_another_limb_is_marked_elsewhere(dance: Recording, gl: moderngl.Context, looks: Renderer) -> None:
    places = []
    for joint in (ARM, "rThigh"):
        free, whole = (
            draw_still(gl, looks, moment_of(dance, AT_S, holds), "ink", SIZE)
            for holds in (None, held(dance, 1.0, joint))
        )
        places.append(np.argwhere(redness(whole) - redness(free) > 60).mean(axis=0))
    assert places[1][0] > places[0][0] + 30, "the thigh is below the arm"


def test_a_look_chooses_the_mark_or_goes_without(dance: Recording, gl: moderngl.Context) -> None:
    chosen = {
        "blue": LookConfig(name="blue", style="plaster", held=HeldConfig(colour="#0000ff")),
        "off": LookConfig(name="off", style="plaster", held=HeldConfig(strength=0.0)),
    }
    with renderer(gl, dance.skeleton, chosen) as made:
        pictures = {
            (name, weight): draw_still(gl, made, moment_of(dance, AT_S, held(dance, weight)), name, SIZE)
            for name in chosen
            for weight in (0.0, 1.0)
        }
    assert np.array_equal(pictures["off", 0.0], pictures["off", 1.0])
    assert (redness(pictures["blue", 1.0]) - redness(pictures["blue", 0.0])).min() < -60
