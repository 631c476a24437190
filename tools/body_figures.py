"""Measures a danced body as an audience sees it: `python -m tools.body_figures JOURNAL [SHOW]`.

How often and how deep upper arms are in the trunk, how fast standing feet slide; beside the show's phrase.
"""

from __future__ import annotations

import sys
from pathlib import Path

from appliance.cli.pictures import load_dance
from appliance.dancer.grounding import survey
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.show.bundle import default_show_path
from appliance.studio.evaluation.dance_figures import BodyFigures
from appliance.studio.standing import measure_standing


def print_figures(journal: Path, show: Path) -> None:
    """A line for the phrase, and one for what was danced."""
    phrase = read_bvh(show / "phrase.bvh")
    floor = survey(phrase)

    def row(name: str, dance: Recording) -> None:
        body = BodyFigures(dance)
        slide = measure_standing(dance.skeleton, dance.poses, dance.roots, floor).slide_cm_s / 100
        arms = body.arms(dance.poses)
        print(
            f"{name}: {len(dance)} poses, an upper arm deep in the trunk in {100 * arms.arm_in_trunk:.2f} %, "
            f"99 % at most {arms.arm_depth_cm:.1f} cm; feet slide at {slide:.3f} m/s"
        )

    row("phrase", phrase)
    row("danced", load_dance(journal).of_puppet(None))


if __name__ == "__main__":
    print_figures(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else default_show_path())
