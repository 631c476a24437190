"""Judges the projector's prediction on a dance: `python -m tools.wall_prediction JOURNAL lShldr`.

JOURNAL: a folder that `bunraku play --emulate --journal JOURNAL` wrote; the joint is the one that its hand
holds, or the root for a figure of which all is led. The display runs at 60 Hz; at each picture the predicted
dance is compared with the dance as it then was.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appliance.box.clock import TICK_S
from appliance.cli.pictures import load_dance
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.projector.prediction import REST, SPAN, Figure, Prediction

PICTURES_HZ = 60.0
STANDS_M_S = 0.05
MILLISECONDS = (10.0, 20.0, 30.0, 40.0)


class Wall(NamedTuple):
    """A wall's pictures: world rotations (N, J, 4) and positions (N, J, 3) at the pictures' times."""

    world: Array
    positions: Array

    def at(self, times: Array, when: Array) -> Wall:
        """At other times (M,), by straight lines between its own (N,)."""
        before = np.clip(np.searchsorted(times, when, side="right") - 1, 0, len(times) - 2)
        share = ((when - times[before]) / TICK_S)[:, None, None]
        return Wall(*(part[before] * (1.0 - share) + part[before + 1] * share for part in self))


def judged(dance: Recording, held: str, milliseconds: float) -> str:
    """A row of the table: of the dance predicted by so much; 0: interpolated, one tick late.

    held: the joint that the hand holds.
    """
    skeleton = dance.skeleton
    joint = skeleton.index(held)
    led = np.isin(np.arange(len(skeleton)), skeleton.descendants(joint))
    positions, world = skeleton.forward_kinematics(dance.poses, dance.roots)
    danced = Wall(_without_jumps(world), positions)
    times = np.arange(len(dance)) * TICK_S
    pictures = np.arange(1.0, times[-1] - 0.5, 1.0 / PICTURES_HZ)
    truth = danced.at(times, pictures)
    when = pictures - TICK_S  # a picture is between the two newest frames
    shown = _predicted(dance, danced, joint, milliseconds / 1000.0 / TICK_S).at(times, when)
    error = np.where(
        led,
        _apart(shown, danced.at(times, when + milliseconds / 1000.0)),
        _apart(shown, danced.at(times, when + REST * milliseconds / 1000.0)),
    )
    off = _apart(shown, truth)
    rough, smooth = (np.sqrt(np.mean(np.diff(wall.positions, 2, axis=0) ** 2)) for wall in (shown, truth))
    name = f"predicted by {milliseconds:g} ms" if milliseconds else "interpolated"
    return (
        f"| {name} | {_worst(error)} | {_worst(off)} | {_worst(off[:, joint])} | {rough / smooth:.2f} | "
        f"{_slides(dance, shown, truth):.1f} |"
    )


def _predicted(dance: Recording, danced: Wall, joint: int, ticks: float) -> Wall:
    if not ticks:
        return danced
    holds = np.zeros(len(dance.skeleton), np.float32)
    holds[joint] = 1.0
    figures = [
        Figure(positions.astype(np.float32), world.astype(np.float32), holds)
        for world, positions in zip(*danced, strict=True)
    ]
    predict = Prediction(dance.skeleton)
    ahead = [
        predict(figures[now], figures[max(now - SPAN, 0)], figures[max(now - 2 * SPAN, 0)], ticks)
        for now in range(len(figures))
    ]
    world, positions = (np.array([one[part] for one in ahead], np.float64) for part in (1, 0))
    return Wall(_without_jumps(world), positions)


def _apart(one: Wall, other: Wall) -> Array:
    """(N, J) degrees between two walls' world rotations."""
    return np.degrees(quaternion.angle_between(_unit(one.world), _unit(other.world)))


def _worst(degrees: Array) -> str:
    """95th percentile."""
    return f"{np.percentile(degrees, 95):.1f}"


def _slides(dance: Recording, shown: Wall, truth: Wall) -> float:
    """95th percentile of how fast feet move on the wall that stand, cm/s."""
    feet = [place for place, name in enumerate(dance.skeleton.names) if name.endswith("Foot")]
    speeds, seen = (
        np.linalg.norm(np.diff(wall.positions[:, feet], axis=0), axis=-1) * PICTURES_HZ
        for wall in (truth, shown)
    )
    return float(100.0 * np.percentile(seen[speeds < STANDS_M_S], 95))


def _without_jumps(rotations: Array) -> Array:
    signs = np.sign(np.sum(rotations[1:] * rotations[:-1], axis=-1, keepdims=True))
    signs[signs == 0.0] = 1.0
    return np.concatenate([rotations[:1], rotations[1:] * np.cumprod(signs, axis=0)])


def _unit(rotations: Array) -> Array:
    unit: Array = rotations / np.linalg.norm(rotations, axis=-1, keepdims=True)
    return unit


def print_table(journal: Path, held: str) -> None:
    """The table of docs/notebook.md."""
    dance = load_dance(journal).recordings[0]
    print(
        "| at 60 pictures a second | error of prediction | off the dance | the held joint | roughness | "
        "standing feet, cm/s |"
    )
    print("|---|---|---|---|---|---|")
    for milliseconds in (0.0, *MILLISECONDS):
        print(judged(dance, held, milliseconds))


if __name__ == "__main__":
    print_table(Path(sys.argv[1]), sys.argv[2])
