"""`bunraku generate`: the process that makes motion ahead for the stage."""

from __future__ import annotations

from appliance.cli.options import BoxFile, ChosenFile, ShowFolder
from appliance.generator.run import run_generator
from appliance.release.choice import box_of


def generate(show: ShowFolder = None, box: BoxFile = None, chosen: ChosenFile = None) -> None:
    """Make motion ahead for the stage: variations, walks and paths, as the show state asks for."""
    run_generator(show, box_of(box, chosen))
