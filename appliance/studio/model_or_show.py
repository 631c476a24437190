"""The options --model and --show of commands that dance with a network of the studio or of a show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.idle_options import refuse_idle
from appliance.show.bundle import named_show

OfShow = Annotated[
    Path | None,
    typer.Option(
        callback=named_show,
        metavar="SHOW",
        help="Instead of --model: a show whose own network does it; 'default' comes with the box.",
    ),
]

OfRegion = Annotated[
    list[str] | None,
    typer.Option(
        "--region",
        help="The part of the body that changes, the rest keeps the phrase: arms, legs, torso, 'left upper "
        "arm', or a joint, with all below it; repeatable.",
    ),
]


def require_either(context: typer.Context, model: Path | None, show: Path | None) -> None:
    """Raises BadParameter unless there is one of both, and for options that do nothing with a show."""
    if (model is None) == (show is None):
        raise typer.BadParameter(
            "Give --show, whose network dances at once (--show default), or --model, a trained checkpoint."
        )
    if show is not None:
        refuse_idle(context, ("recordings",), "with --show, which has its phrase to compare with")
