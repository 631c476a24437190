"""The figures of the wall's prediction, on a dance whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.recording import Recording
from tests.bundles import FIGURE
from tools.wall_prediction import judged


def dance(degrees_a_second: float) -> Recording:
    """Ten seconds of an arm that turns evenly."""
    poses = np.tile(quaternion.IDENTITY.astype(float), (500, len(FIGURE), 1))
    turns = np.radians(degrees_a_second) * np.arange(500) / 50
    poses[:, FIGURE.index("lShldr")] = quaternion.from_axis_angle([0, 0, 1], turns)
    return Recording(FIGURE, poses, np.tile([0.0, 1.0, 0.0], (500, 1)), 50.0)


def figures(row: str) -> list[float]:
    return [float(part) for part in row.split("|")[2:-1]]


@pytest.mark.parametrize(("milliseconds", "wanted"), [(0.0, 4.0), (10.0, 2.4), (20.0, 0.8)])
def test_an_even_turn_is_behind_by_what_is_not_predicted(milliseconds: float, wanted: float) -> None:
    _, _, behind, *_ = figures(
        judged(dance(200.0), "lShldr", milliseconds)
    )  # 0.2 of the velocity is not carried on
    assert behind == pytest.approx(wanted, abs=0.11)


def test_what_is_not_predicted_is_as_rough_as_the_dance_and_stands_as_still() -> None:
    error, _, _, rough, feet = figures(judged(dance(200.0), "lShldr", 0.0))
    assert (error, feet) == (0.0, 0.0) and rough == pytest.approx(1.0, abs=0.05)
