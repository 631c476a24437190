"""`--chosen FILE`: show and box file as the preflight chose them, for every command that has a `--box`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.show.choice import APPLIANCE_BOX, Choice

ChosenFile = Annotated[
    Path | None,
    typer.Option(
        "--chosen", help="Show and box file as `bunraku preflight` chose them: /run/bunraku/chosen.json."
    ),
]


def box_of(box: Path | None, chosen: Path | None) -> Path | None:
    """The box file that a command means; raises typer.BadParameter when both ways are given."""
    if chosen is None:
        return box
    if box is not None:
        raise typer.BadParameter("Give --box or --chosen, not both.")
    choice = Choice.read(chosen)
    return choice.first.box if choice is not None else APPLIANCE_BOX
