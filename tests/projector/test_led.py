"""How far a limb follows the held joint: all the way, not at all, late, or without a hand."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from appliance.outputs.coupling import LAGS, ROW_S, ROWS, coupled, led_by
from appliance.pose.anatomy import Anatomy
from appliance.pose.recording import Recording
from appliance.projector.picture.looks.strings import tied
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of
from tests.projector import skeletons
from tests.projector.golden_looks import AT_S, SIZE

HAND, FOLLOWER, LATE, RANDOM, STANDING = range(1, 6)


def dance(seed: int, lag: int = 4) -> np.ndarray:
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
    return places.astype(np.float32)


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


def test_partners_are_coupled_where_they_move_alike_and_strangers_are_not() -> None:
    """Null: another dance. It makes no difference which of the two is late."""

    def later(trail: np.ndarray, rows: int) -> np.ndarray:
        return np.roll(trail, rows, axis=0)

    def slower(trail: np.ndarray) -> np.ndarray:
        """In another rhythm: all dances of this test have the same one."""
        at = 0.6 * np.arange(ROWS)
        low = at.astype(int)
        part = (at - low)[:, None, None].astype(np.float32)
        return np.asarray((1 - part) * trail[low] + part * trail[low + 1])

    seeds = range(20)
    alike, late, strangers = (
        np.median([coupled(dance(seed), other(seed))[RANDOM] for seed in seeds])
        for other in (dance, lambda seed: later(dance(seed), 6), lambda seed: slower(dance(seed + 100)))
    )
    assert alike > 0.9
    assert late > 0.5
    assert strangers < 0.4 * late, "strangers look like partners"
    assert np.array_equal(coupled(dance(1), dance(2)), coupled(dance(2), dance(1)))


def test_strings_run_between_partners(gl: moderngl.Context, dance: Recording, looks: Renderer) -> None:
    """Two figures that dance the same are tied to each other; one that stands still is tied to nobody."""
    here = moment_of(dance, AT_S, None)
    (one,) = here.puppets

    def beside(trail: bool) -> int:
        aside = np.float32([1.2, 0.0, 0.0])
        moved = [(at + aside, turn) for at, turn in one.trail]
        still = [(one.positions + aside, one.world)] * len(moved)
        other = replace(one, positions=one.positions + aside, trail=tuple(moved if trail else still))
        picture = draw_still(gl, looks, replace(here, puppets=(one, other)), "strings", SIZE)
        return int(picture[:, SIZE[0] // 2 - 3 : SIZE[0] // 2 + 3].astype(int).sum())

    assert beside(trail=True) > 1.5 * beside(trail=False)
