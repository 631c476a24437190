"""`bunraku journal`: list what the box has recorded, and export it to a stick."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

journal = typer.Typer(help="What this box has recorded.", no_args_is_help=True)
BoxFile = Annotated[Path | None, typer.Option(help="box.yaml of the venue.")]
Folder = Annotated[Path | None, typer.Option(help="Journal; left out: the one of the box file.")]


@journal.command("list")
def list_journal(box: BoxFile = None, folder: Folder = None) -> None:
    """List the runs of the show that the journal holds."""
    raise NotImplementedError


@journal.command("export")
def export_journal(
    to: Annotated[Path | None, typer.Argument(help="Folder or file; left out: the stick.")] = None,
    box: BoxFile = None,
    folder: Folder = None,
) -> None:
    """Write the journal into one file, on a stick for example."""
    raise NotImplementedError
