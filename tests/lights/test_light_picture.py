"""Light in the drawing of a rig: as wide, as bright, as coloured and aimed as the beams that it shows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from appliance.lights.beams import LAMP, SPOT, WASH, Beam
from appliance.lights.label_places import Rectangle, free_place
from appliance.lights.light_picture import Space, haze, on_floor, reaching
from appliance.lights.plan import drawn_space
from appliance.pose import quaternion
from appliance.pose.body import Body
from tests.lights.rigs import SKELETON, lights

SPACE = Space(np.array([-4.0, 0.0, -4.0]), np.array([4.0, 5.0, 4.0]))
VIEWS = {"from above": (0, 2), "from the audience": (0, 1)}


def beam(place: Any = (0, 4, 0), way: Any = (0, -1, 0), **changed: Any) -> Beam:
    [fixture] = lights([{"name": "par", "profile": "led-par", "address": 1}]).fixtures
    direction = np.array(way, float) / np.linalg.norm(way)
    made = Beam(fixture, np.array(place, float), direction, np.ones(3), 1.0, 30.0, LAMP)
    return made._replace(**changed)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("way", [(0, -1, 0), (0.7, -1, 0.4), (0.2, 0.1, 1), (0, 0, -1), (1, -0.02, 0)])
@pytest.mark.parametrize("kind", [SPOT, WASH])
def test_each_line_of_sight_has_all_the_light_along_it(view: str, way: Any, kind: str) -> None:
    """Against points all along the lines, one by one."""
    one, (right, up) = beam(place=(0.3, 2.5, -0.2), way=way, kind=kind), VIEWS[view]
    depth, count = 3 - right - up, 4000
    seen = haze([one], SPACE, right, up, (30, 30))
    low, high = SPACE
    middles = [low[axis] + (high[axis] - low[axis]) * (np.arange(30) + 0.5) / 30 for axis in (right, up)]
    along = low[depth] + (high[depth] - low[depth]) * (np.arange(count) + 0.5) / count
    points = np.empty((30, 30, count, 3))
    points[..., right], points[..., up], points[..., depth] = (
        middles[0][None, :, None],
        middles[1][:, None, None],
        along,
    )
    # Along a beam the air and a place in it get the same light; only their brightness differs.
    whole = reaching([one], points).mean(axis=2) * (high[depth] - low[depth])
    ratio = seen[..., 0].sum() / whole[..., 0].sum()
    bright = whole[..., 0] > 0.02 * whole[..., 0].max()
    np.testing.assert_allclose(seen[..., 0][bright], ratio * whole[..., 0][bright], rtol=0.25)
    assert not seen[whole[..., 0] == 0.0].any()


def test_a_beam_fades_along_its_throw_and_towards_its_edge_and_ends_there() -> None:
    air = haze([beam()], SPACE, 0, 1, (200, 321))[..., 0]
    axis = air[:, 160]
    assert (np.diff(axis[10:140]) > 0).all(), "the lamp is at 4 m"
    row = air[40]
    assert (np.diff(row[row > 0][: np.count_nonzero(row) // 2]) > 0).all()
    reach = (4.0 - 1.0125) * np.tan(np.radians(15.0))
    x = -4.0 + 8.0 * (np.arange(321) + 0.5) / 321
    assert not row[np.abs(x) > reach].any() and row[np.abs(x) < 0.9 * reach].all()


def test_a_pool_is_where_the_cone_meets_the_floor() -> None:
    x = np.linspace(-4, 4, 401)
    pool = on_floor([beam(way=(1, -1, 0), place=(-2, 3, 0))], x, x)[..., 0]
    rows, columns = np.nonzero(pool)
    near, far = (-2 + 3 * np.tan(np.radians(45 + turned)) for turned in (-15, 15))
    assert (x[columns.min()], x[columns.max()]) == pytest.approx((near, far), abs=0.05)
    assert np.ptp(x[rows]) < far - near, "an ellipse, long along the throw"
    assert not on_floor([beam(way=(1, 0.5, 0))], x, x).any()


def test_lights_add_up_by_level_and_colour_and_a_dark_one_adds_nothing() -> None:
    red, blue = beam(colour=np.array([1.0, 0, 0])), beam(colour=np.array([0, 0, 1.0]), level=0.5)
    x = np.linspace(-1, 1, 9)
    both = on_floor([red, blue, beam(level=0.0)], x, x)
    np.testing.assert_allclose(both[..., 2], 0.5 * both[..., 0])
    assert both[4, 4, 0] > 0 and not both[..., 1].any()


def test_both_views_have_one_size_and_hold_lamps_dancer_and_pools() -> None:
    dancer = Body(SKELETON).cones(np.zeros((2, 3)), np.tile(quaternion.IDENTITY, (2, 1)))
    for places in ([(-6, 7, -1), (6, 7, 1)], [(0, 2, -9), (0, 2, 9)], [(0, 12, 0)]):
        low, high = drawn_space([beam(place=place) for place in places], dancer, np.zeros((1, 3)))
        assert high[1] - low[1] == pytest.approx(high[2] - low[2])
        assert (high[1] - low[1]) / (high[0] - low[0]) < 1.5
        for x, y, z in places:
            pool = min(y * np.tan(np.radians(15.0)), 2.0)
            assert low[0] < x - pool and x + pool < high[0] and y < high[1] and low[2] < z - pool


def test_labels_meet_neither_each_other_nor_what_is_drawn_and_stay_within_the_walls() -> None:
    random, walls = np.random.default_rng(1), Rectangle(0, 0, 640, 420)
    lamps = random.uniform([20, 20], [620, 400], (60, 2))
    taken = [Rectangle(*(at - 8), *(at + 8)) for at in lamps]
    placed = 0
    for at in lamps:
        found = free_place(at, (66, 24), np.array([0.0, 1.0]), taken, walls)
        if found is not None:
            assert walls.holds(found) and not any(found.meets(one) for one in taken)
            taken.append(found)
            placed += 1
    assert 20 < placed < 60, "where there is no room there is no label"


def test_a_label_goes_away_from_its_beam() -> None:
    walls = Rectangle(0, 0, 100, 100)
    found = free_place(np.array([50.0, 50.0]), (20, 10), np.array([0.0, 1.0]), [], walls)
    assert found is not None and found.bottom > 50 and found.middle[0] == 50
