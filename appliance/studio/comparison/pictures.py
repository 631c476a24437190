"""Pictures of two versions of a dance: both figures at the worst moments, and each joint over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from appliance.pictures.filmstrip import draw_rows
from appliance.pictures.filmstrip_stage import SLATE, Row
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.pictures import FAINT, INK, IVORY, VERMILION, dressed, new_figure, save

if TYPE_CHECKING:
    from appliance.studio.comparison.versions import Comparison, Moment

MOST_DEGREES = 60.0  # the brightest colour


def draw_moments(
    path: Path, found: Comparison, moments: Sequence[Moment], teacher: str, student: str
) -> None:
    """The teacher above the student, whom the teacher's ghost is behind; the joint that differs in colour."""
    if not moments:
        return
    places = sorted(moments, key=lambda one: one.tick)
    chosen = np.array([one.tick for one in places])
    names = {found.name(place): joint for place, joint in enumerate(found.joints)}
    holds = np.zeros(found.teacher.poses.shape[:2])
    for one in places:
        holds[one.tick, names[one.joint]] = 1.0
    stamps = tuple(f"{one.teacher_s:.1f} s" for one in places)
    theirs = tuple(f"{one.student_s:.1f} s\n{one.joint} {one.degrees:.0f}°" for one in places)
    above = Row(found.teacher.poses, found.teacher.roots, chosen, teacher, stamps=stamps)
    ghost = Row(found.teacher.poses, found.teacher.roots, chosen, colour=SLATE)
    below = Row(
        found.student.poses, found.student.roots, chosen, student, behind=ghost, holds=holds, stamps=theirs
    )
    draw_rows(
        path, found.teacher.skeleton, [above, below], FPS, "Where they differ most", "the joint that differs"
    )


def draw_joints_over_time(
    path: Path, found: Comparison, moments: Sequence[Moment], teacher: str, student: str
) -> None:
    """A map of joints by seconds of the teacher, and below it the student's tempo and delay."""
    figure = new_figure(12.0, 2.6 + 0.24 * len(found.joints))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[0.24 * len(found.joints), 1.5])
    at = found.alignment
    seconds = (at.first + np.arange(len(found.degrees))) / FPS
    order = [list(found.by_joint).index(found.name(place)) for place in range(len(found.joints))]
    rows = np.empty((len(found.joints), len(seconds)))
    rows[order] = found.degrees.T
    dressed(above).grid(visible=False)
    extent = (seconds[0], seconds[-1], len(rows) - 0.5, -0.5)
    image = above.imshow(
        rows, aspect="auto", extent=extent, cmap="inferno", vmin=0, vmax=MOST_DEGREES, interpolation="nearest"
    )
    above.set_yticks(range(len(rows)), [f"{name}  {value:.0f}°" for name, value in found.by_joint.items()])
    above.set_title(f"{student} beside {teacher}: degrees apart, aligned in time", color=INK, loc="left")
    bar = figure.colorbar(image, ax=above, pad=0.01, extend="max")
    bar.ax.tick_params(colors=FAINT, labelsize=8)
    for one in moments:
        for axes in (above, below):
            axes.axvline(one.teacher_s, color=IVORY, linewidth=0.8, alpha=0.7)
    dressed(below).plot(
        seconds, at.tempo_over_time, color=VERMILION, linewidth=1.4, label="tempo of the teacher's"
    )
    below.set_ylim(0.5, 2.0)
    below.set_yscale("log", base=2)
    below.set_yticks([0.5, 0.8, 1.0, 1.25, 2.0], ["0.5", "0.8", "1", "1.25", "2"])
    below.set_title("The student's tempo, of the teacher's", color=INK, loc="left", fontsize=10)
    below.set_xlabel("seconds of the teacher", color=FAINT)
    save(figure, path)
