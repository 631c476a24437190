"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.show.bundle import bundled_shows, named_show

_NAMES = ", ".join(bundled_shows())
_SHOW = f"Show bundle, or the name of one that comes with the box: {_NAMES}."
SHOW_OR_NAME = f"{_SHOW} Default: default."
ShowFolder = Annotated[Path | None, typer.Option("--show", callback=named_show, help=SHOW_OR_NAME)]
ThisShowFolder = Annotated[
    Path | None,
    typer.Option("--show", callback=named_show, help=f"{_SHOW} Default: this box's, elsewhere default."),
]
BoxFile = Annotated[
    Path | None, typer.Option("--box", help="box.yaml of the venue. Default: everything on this machine.")
]
ThisBoxFile = Annotated[
    Path | None, typer.Option("--box", help="box.yaml of the venue. Default: this box's.")
]
ChosenFile = Annotated[
    Path | None,
    typer.Option(
        "--chosen", help="Show and box file that `bunraku preflight` chose: /run/bunraku/chosen.json."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def command_group(help_text: str, needs_command: bool = False) -> typer.Typer:
    """The commands below one word, like `bunraku sensors ...`."""
    return typer.Typer(
        help=help_text, no_args_is_help=needs_command, add_completion=False, pretty_exceptions_enable=False
    )


def is_for_subcommand(context: typer.Context, *given: object) -> bool:
    """Whether a command of the group was named; options before it would have no effect and are refused."""
    if context.invoked_subcommand is not None and any(given):
        raise typer.BadParameter(f"write options behind '{context.invoked_subcommand}'")
    return context.invoked_subcommand is not None
