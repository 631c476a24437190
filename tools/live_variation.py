"""Measures `/phrase vary` of a show: `python -m tools.live_variation [SHOW]`.

A row for each sigma: mean joint angle from the phrase, and jerk beside the phrase's own (1: as smooth). The
null product is a phrase whose joints are turned by noise of the same size, smooth over half a second.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from appliance.dancer.grounding import survey
from appliance.dancer.loop import Loop
from appliance.dancer.material.cyclic import Cycle
from appliance.dancer.material.maker import Maker
from appliance.dancer.phrase import Phrase
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.quaternion import Array
from appliance.show.bundle import named_show
from appliance.show.show import load_show
from appliance.studio.evaluation.dance_figures import jerk

SIGMAS = (0.0, 0.5, 1.0, 2.0)
SEEDS = range(1, 5)
WINDOW, FADE = 8, 50


def row(name: str, phrase: Array, danced: list[Array]) -> str:
    """A row of the table, of loops (T, J, 4) made with several seeds."""
    degrees = np.mean([np.degrees(quaternion.angle_between(one, phrase)).mean() for one in danced])
    return f"| {name} | {degrees:.2f} | {np.mean([jerk(one) for one in danced]) / jerk(phrase):.2f} |"


def trembling(phrase: Array, degrees: float, seed: int) -> Array:
    """The phrase (T, J, 4) turned by smooth noise that leads nowhere."""
    waves = np.random.default_rng(seed).standard_normal((len(phrase), phrase.shape[1], 3))
    smooth = np.apply_along_axis(lambda one: np.convolve(one, np.hanning(27)[1:-1], "same"), 0, waves)
    axes = smooth / np.linalg.norm(smooth, axis=-1, keepdims=True)
    size = np.linalg.norm(smooth, axis=-1)
    return quaternion.multiply(
        quaternion.from_axis_angle(axes, np.radians(degrees) * size / size.mean()), phrase
    )


def main() -> None:
    """Print the table."""
    show = load_show(named_show(Path(sys.argv[1] if len(sys.argv) > 1 else "default")) or "")
    recording = read_bvh(next(iter(show.phrases.values()))).resampled(50.0)
    loop: Loop = Phrase(0, "main", recording, survey(recording), FADE, WINDOW).cut(0.0, 20.0)
    maker = Maker(show.skeleton, show.motion_networks, lambda _: loop, grounded=True)
    places = maker.network("vary").places
    own = Cycle.of(loop).poses[:, places].astype(float)
    print("| sigma | degrees from the phrase | jerk of the phrase's |\n|---|---|---|")
    for sigma in SIGMAS:
        recipe = {"source": "vary", "phrase": "main", "sigma": sigma, "number": 1001}
        made = [maker.make(recipe | {"seed": seed}).poses[:-1, places].astype(float) for seed in SEEDS]
        print(row(f"{sigma:g}", own, made))
    print(row("null: smooth noise", own, [trembling(own, 10.0, seed) for seed in SEEDS]))


if __name__ == "__main__":
    main()
