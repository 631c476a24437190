"""report.png: names of joints can be read, however many and long they are; each baseline has a bar."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from appliance.studio.evaluation.pictures import dressed, new_figure
from appliance.studio.evaluation.report_picture import (
    ALIVE,
    COLOURS,
    WIDTH_INCHES,
    alive,
    draw_alive,
    draw_joints,
)
from tests.pose.conventions import skeleton_of
from tests.studio.tiny import moving, skeleton

USUAL = tuple(skeleton().names[joint] for joint in moving())


@pytest.mark.parametrize(
    "names",
    [USUAL, skeleton_of("OptiTrack").names, tuple(f"mixamorig:LeftHandPinky{n}" for n in range(100))],
    ids=["17 short ones", "51 with a prefix", "100 long ones"],
)
def test_names_of_joints_do_not_run_into_each_other(names: tuple[str, ...]) -> None:
    figure = new_figure(WIDTH_INCHES, 5)
    axes = dressed(figure.add_subplot())
    draw_joints(axes, {"by_joint_degrees": {k: dict.fromkeys(names, 1.0) for k in ("1", "10")}})
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    labels = axes.get_xticklabels()
    assert [label.get_text() for label in labels] == list(names)
    boxes = [label.get_window_extent() for label in labels]
    apart = np.diff([label.get_transform().transform(label.get_position())[0] for label in labels])
    if slope := labels[0].get_rotation():
        letters_px = labels[0].get_fontsize() * figure.dpi / 72
        assert apart.min() * np.sin(np.radians(slope)) > letters_px
    else:
        assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
    assert min(box.x0 for box in boxes) > 0 and min(box.y0 for box in boxes) > 0


def test_the_held_dance_has_a_bar_beside_each_baseline() -> None:
    rows = [{kind: dict.fromkeys(ALIVE, value) for kind in COLOURS} for value in (0.5, 0.9)]
    rows[1]["network"]["critic"] = None
    report = {"puppetry": {"lShldr": {"baselines": rows[0]}, "head": {"baselines": rows[1]}, "free": {}}}
    compared = alive(report)
    assert list(compared) == list(COLOURS)
    assert compared["network"]["critic"] == 0.5 and compared["network"]["energy_legs"] == pytest.approx(0.7)
    axes = dressed(new_figure(WIDTH_INCHES, 4).add_subplot())
    draw_alive(axes, compared)
    assert len(axes.patches) == len(COLOURS) * len(ALIVE)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == list(COLOURS)


@pytest.mark.parametrize("puppetry", [{}, {"puppetry": {"free": {"10": {}}, "lShldr": {"10_9": {}}}}])
def test_a_report_without_comparison_has_no_such_bars(puppetry: dict[str, object]) -> None:
    assert alive(puppetry) == {}
