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


def require_either(context: typer.Context, model: Path | None, show: Path | None) -> None:
    """Raises BadParameter unless there is one of both, and for options that do nothing with a show."""
    if (model is None) == (show is None):
        raise typer.BadParameter(
            "Give --show, whose network dances at once (--show default), or --model, a trained checkpoint."
        )
    if show is not None:
        refuse_idle(context, ("recordings",), "with --show, which has its phrase to compare with")
