"""How far a limb follows the held joint: all the way, not at all, late, or without a hand."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from appliance.body.body_mesh import body_mesh
from appliance.outputs.coupling import LAGS, ROW_S, ROWS, coupled, led_by
from appliance.pose.anatomy import Anatomy
from appliance.pose.recording import Recording
from appliance.projector.picture import scene
from appliance.projector.picture.camera import view
from appliance.projector.picture.looks.strings import tied
from appliance.projector.picture.poses import poses_of
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of
from appliance.show.look import CameraConfig, LookConfig
from tests.projector import skeletons
from tests.projector.golden_looks import AT_S, SIZE, renderer

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


def test_strings_leave_the_picture_above_the_hand_that_holds(gl: moderngl.Context, dance: Recording) -> None:
    """In the colour of what is taut; without a hand they hang from above the root, slack."""
    looks = {"strings": LookConfig(name="strings", style="strings", vignette=0.0, fog=0.0)}
    with renderer(gl, dance.skeleton, looks) as made:
        free, left, right = (
            draw_still(gl, made, moment_of(dance, AT_S, held), "strings", SIZE).astype(int)
            for held in (None, holding(dance, "lHand"), holding(dance, "rHand"))
        )
    for picture, hand in ((left, "lHand"), (right, "rHand")):
        leaving = picture[5:20].max(axis=0)
        assert leaving.max() > 80, "no thread leaves the picture at its top"
        brightest = int(leaving.sum(axis=1).argmax())
        assert abs(brightest - column(dance, hand)) <= 2, "its hand's thread does not lead up from it"
    assert 80 > free[5:20].max() > 15
    assert (left[..., 0] - left[..., 2]).max() > 80 > (free[..., 0] - free[..., 2]).max()


def test_the_more_closely_a_limb_follows_the_brighter_and_straighter_its_string(
    gl: moderngl.Context, dance: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    leader, limb = (dance.skeleton.index(name) for name in ("lHand", "rShin"))
    plain = {"name": "x", "style": "strings", "vignette": 0.0, "fog": 0.0, "glow": 0.0}
    look = LookConfig.model_validate({**plain, "held": {"strength": 0.0}})
    peaks, bends = [], []
    with renderer(gl, dance.skeleton, {"x": look}) as made:

        def drawn(follows: float) -> np.ndarray:
            led = np.zeros(len(dance.skeleton), np.float32)
            led[limb] = follows
            monkeypatch.setattr(scene, "led_by", lambda *_: (leader, led))
            moment = moment_of(dance, AT_S, holding(dance, "lHand"))
            return draw_still(gl, made, moment, "x", (640, 360)).astype(int).sum(axis=2)

        slack = drawn(0.0)
        for follows in (0.4, 0.7, 1.0):
            light = drawn(follows) - slack
            rows, columns = np.nonzero(light > 0.4 * light.max())
            fit = np.polyfit(rows, columns, 1)
            peaks.append(np.percentile(light[rows, columns], 90))
            bends.append(np.abs(columns - np.polyval(fit, rows)).max())
    assert peaks == sorted(peaks) and peaks[-1] > 1.5 * peaks[0]
    assert bends == sorted(bends, reverse=True) and bends[-1] < 4 < bends[0]


def holding(dance: Recording, name: str) -> np.ndarray:
    held = np.zeros(len(dance.skeleton), np.float32)
    held[dance.skeleton.index(name)] = 1.0
    return held


def column(dance: Recording, name: str) -> int:
    """Of the picture, in which a joint is."""
    moment = moment_of(dance, AT_S)
    mesh = body_mesh(dance.skeleton)
    sole = float(mesh.bind_positions[:, 1].min() - mesh.vertices[:, 1].min())
    poses = poses_of(moment, moment.puppets[0], mesh.height, sole)
    camera = CameraConfig()
    seen = view(camera, camera, 1.0, moment.time_s, poses, SIZE[0] / SIZE[1])
    return int(seen.on_picture(poses.positions[0, dance.skeleton.index(name)])[0] * SIZE[1])


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
