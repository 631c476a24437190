"""The homography is exact, and only corners on which a picture can lie are taken."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.projector.corners import WHOLE, Corners, complaint, homography

PINNED: Corners = ((0.1, 0.05), (0.93, 0.12), (0.85, 0.97), (0.02, 0.8))
near = st.floats(-0.2, 0.2)


def mapped(corners: Corners, u: float, v: float) -> np.ndarray:
    x, y, w = homography(corners) @ (u, v, 1.0)
    return np.array([x / w, y / w])


@given(st.lists(near, min_size=8, max_size=8))
def test_the_four_corners_land_on_the_four_wanted_points(moves: list[float]) -> None:
    a, b, c, d = ((x + dx, y + dy) for (x, y), dx, dy in zip(WHOLE, moves[::2], moves[1::2], strict=True))
    assert complaint((a, b, c, d)) == ""
    for (u, v), wanted in zip(WHOLE, (a, b, c, d), strict=True):
        assert np.allclose(mapped((a, b, c, d), u, v), wanted, atol=1e-12)


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_straight_lines_stay_straight(u: float, v: float, to_u: float, to_v: float) -> None:
    ends = [mapped(PINNED, u, v), mapped(PINNED, to_u, to_v)]
    along = ends[1] - ends[0]
    for share in np.linspace(0, 1, 7):
        middle = mapped(PINNED, u + share * (to_u - u), v + share * (to_v - v)) - ends[0]
        assert abs(along[0] * middle[1] - along[1] * middle[0]) < 1e-9


def test_without_corner_pin_nothing_moves() -> None:
    assert np.array_equal(homography(WHOLE), np.eye(3))


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (((1, 0), (0, 0), (0, 1), (1, 1)), "from behind"),
        (((0, 0), (1, 0), (0.3, 0.3), (0, 1)), "fold"),
        (((0, 0), (1, 1), (1, 0), (0, 1)), "fold"),
        (((0, 0), (1, 0), (1, 0), (0, 1)), "fold"),
        (((0, 0), (0.5, 0), (1, 0), (0, 1)), "fold"),
        (((0, 0), (3, 0), (1, 1), (0, 1)), "outside"),
        (((0, 0), (float("nan"), 0), (1, 1), (0, 1)), "not a number"),
    ],
)
def test_impossible_corners_are_refused_with_a_sentence(corners: Corners, message: str) -> None:
    assert message in complaint(corners)
    assert "stays as it is" in complaint(corners)
