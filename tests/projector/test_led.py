"""How far a limb follows the held joint: all the way, not at all, late, or without a hand."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from appliance.pose.anatomy import Anatomy
from appliance.pose.recording import Recording
from appliance.projector.picture.led import LAGS, led_by
from appliance.projector.picture.looks.strings import tied
from appliance.projector.picture.poses import ROW_S, ROWS, Poses
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of
from tests.projector import skeletons
from tests.projector.golden_looks import AT_S, SIZE

HAND, FOLLOWER, LATE, RANDOM, STANDING = range(1, 6)


def dance(seed: int, lag: int = 4) -> Poses:
    """A still root, a hand, a limb that does the same, one that does it later, one by itself, a still one."""
    rng = np.random.default_rng(seed)
    long = ROWS + 3 * LAGS

    def wandering() -> np.ndarray:
        steps = rng.normal(size=(long + 8, 3))
        smooth = np.stack([np.convolve(one, np.hanning(9), "valid") for one in steps.T], axis=1)
        return np.cumsum(0.012 * smooth * (1 + np.sin(np.arange(long) / 5.0))[:, None], axis=0)

    hand, other = wandering(), wandering()
    places = np.zeros((ROWS, 6, 3))
    places[:, HAND] = places[:, FOLLOWER] = hand[LAGS : LAGS + ROWS]
    places[:, LATE] = hand[LAGS + lag : LAGS + lag + ROWS]
    places[:, RANDOM] = other[:ROWS]
    return Poses(places.astype(np.float32), np.tile(np.float32([1, 0, 0, 0]), (ROWS, 6, 1)))


def holds(firmly: float = 1.0) -> np.ndarray:
    held = np.zeros(6, np.float32)
    held[HAND] = firmly
    return held


def test_a_limb_that_moves_alike_is_led_and_others_are_not() -> None:
    led = np.array([led_by(dance(seed), holds())[1] for seed in range(30)])
    assert (led[:, HAND] == 1).all() and (led[:, STANDING] == 0).all()
    alike, late, by_itself = (np.median(led[:, limb]) for limb in (FOLLOWER, LATE, RANDOM))
    assert alike > 0.8 and late > 0.6, (alike, late)
    assert by_itself < 0.75 * late, "chance looks like an answer"


def test_a_limb_that_follows_too_late_counts_less() -> None:
    late, too_late = (
        np.median([led_by(dance(seed, lag), holds())[1][LATE] for seed in range(30)]) for lag in (4, 2 * LAGS)
    )
    assert too_late < 0.8 * late, f"{too_late} at {2 * LAGS * ROW_S} s"


def test_as_firmly_as_the_hand_holds() -> None:
    full, half = (led_by(dance(1), holds(firmly))[1] for firmly in (1.0, 0.5))
    np.testing.assert_allclose(half, 0.5 * full, atol=1e-6)
    assert led_by(dance(1), holds(0.0))[0] is None and not led_by(dance(1), None)[1].any()


@pytest.mark.parametrize("name", skeletons.ALL)
def test_strings_are_tied_to_every_skeleton(name: str) -> None:
    skeleton = skeletons.ALL[name]()
    joints = tied(Anatomy(skeleton))
    assert joints and len(joints) == len(set(joints)) and max(joints) < len(skeleton)


def test_strings_run_from_the_held_joint(gl: moderngl.Context, dance: Recording, looks: Renderer) -> None:
    held = np.zeros(len(dance.skeleton), np.float32)
    held[dance.skeleton.index("lShldr")] = 1.0
    free, led = (
        draw_still(gl, looks, moment_of(dance, AT_S, one), "strings", SIZE).astype(int)
        for one in (None, held)
    )
    assert led.max() > 200
    assert (led[..., 0] - led[..., 2]).max() > 80 > (free[..., 0] - free[..., 2]).max()
    assert free[:20].max() > 25 > led[:20].max(), "no strings from above, or they stay while a hand holds"
