"""The mesh: which points may be where, and what is between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.box.orders import Order
from appliance.projector.alignment import Alignment, AlignmentFile
from appliance.projector.controls import Controls
from appliance.projector.corners import WHOLE
from appliance.projector.warp import FINE, NOT_WARPED, complaint, fine, moved
from appliance.show.projector import ProjectorConfig
from tests.logged import said

MIDDLE = 12


def test_the_surface_goes_through_each_point_without_a_kink() -> None:
    warp = moved(moved(NOT_WARPED, MIDDLE, (0.1, 0.0)), 7, (0.0, -0.05))
    found = fine(warp)
    assert np.allclose(found[::8, ::8].reshape(-1, 2), warp)
    steps = np.diff(found[16, :, 0], 2)
    assert np.abs(np.diff(steps)).max() < 0.004  # straight lines between the points: 0.0125 at each of them
    assert fine(NOT_WARPED).shape == (FINE, FINE, 2)


@pytest.mark.parametrize(
    ("warp", "message"),
    [
        (moved(NOT_WARPED, MIDDLE, (0.3, 0.0)), "too far"),
        (moved(moved(NOT_WARPED, 11, (0.2, 0.0)), MIDDLE, (-0.2, 0.0)), "folds"),
        (((0.0, 0.0),) * 9, "no mesh of 25"),
        (moved(NOT_WARPED, MIDDLE, (float("nan"), 0.0)), "no mesh of 25"),
    ],
)
def test_what_no_wall_needs_is_refused(warp: tuple[tuple[float, float], ...], message: str) -> None:
    assert message in complaint(warp, WHOLE)
    assert complaint(moved(NOT_WARPED, MIDDLE, (0.1, 0.1)), WHOLE) == ""


@pytest.mark.parametrize("point", [0, 4, 20, 24, 25, -1])
def test_corners_are_the_corner_pins(point: int) -> None:
    with pytest.raises(ValueError, match="without the corners"):
        moved(NOT_WARPED, point, (0.1, 0.1))


def test_orders_pull_flatten_and_keep_it_over_a_restart(tmp_path: Path) -> None:
    file = AlignmentFile(tmp_path, ProjectorConfig())
    controls = Controls(file.alignment, file.keep)
    assert controls.carry_out(Order("warp", (13.0, 0.05, -0.02)))[0]
    assert controls.carry_out(Order("warp", (13.0, 0.05, 0.0)))[0]
    assert not controls.carry_out(Order("warp", (1.0, 0.05, 0.0)))[0]
    assert not controls.carry_out(Order("warp", (13.0, 0.4, 0.0)))[0]
    file.close()
    again = AlignmentFile(tmp_path, ProjectorConfig())
    assert again.alignment.warp[MIDDLE] == (0.1, -0.02)
    assert again.overrides() == ["The picture is warped as it was last warped by hand."]
    controls = Controls(again.alignment, again.keep)
    assert controls.report()["warp"][MIDDLE] == (0.1, -0.02)
    assert controls.carry_out(Order("warp/reset", ()))[0]
    again.close()
    assert AlignmentFile(tmp_path, ProjectorConfig()).alignment == Alignment()
    assert said == []


def test_corners_that_would_fold_the_mesh_are_refused() -> None:
    kept: list[Alignment] = []
    controls = Controls(Alignment(warp=moved(NOT_WARPED, MIDDLE, (0.2, 0.0))), kept.append)
    done, message = controls.place_all(((0.0, 0.0), (0.3, 0.0), (0.3, 1.0), (0.0, 1.0)))
    assert (done, kept) == (False, [])
    assert "folds" in message
