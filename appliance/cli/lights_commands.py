"""The words of `bunraku lights ...` on the command line."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from appliance.cli.options import (
    BoxFile,
    ChosenFile,
    ShowFolder,
    ThisBoxFile,
    ThisShowFolder,
    command_group,
    is_for_subcommand,
)
from appliance.release.choice import box_of
from appliance.show.asked_for import require_wires
from appliance.show.bundle import named_show

lights = command_group("Light the rig by the dance; walk through it, look at it, convert fixture profiles.")


@lights.callback(invoke_without_command=True)
def light(
    context: typer.Context,
    show: Annotated[
        Path | None,
        typer.Option(callback=named_show, help="Show bundle. Default: the one that the stage dances."),
    ] = None,
    box: BoxFile = None,
    chosen: ChosenFile = None,
) -> None:
    """Light the rig by the dance that `bunraku play` dances, until Ctrl-C; `play` starts this by itself."""
    if is_for_subcommand(context, show, box, chosen):
        return
    box = box_of(box, chosen)
    require_wires(box)
    from appliance.lights.run import run_lights

    run_lights(show, box)


@lights.command("test")
def walk_through(
    show: ThisShowFolder = None,
    box: ThisBoxFile = None,
    fixture: Annotated[list[str] | None, typer.Option(help="This fixture alone; repeatable.")] = None,
    attribute: Annotated[str | None, typer.Option(help="This attribute alone; `aim` for heads.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, max=600, help="How long each attribute moves.")] = 3.0,
) -> None:
    """Walk through the rig, fixture by fixture, attribute by attribute, and say what should be seen."""
    from appliance.lights.rig_walk import walk_rig
    from appliance.release.installed_box import show_and_box_here

    show, box = show_and_box_here(show, box)
    with _named_options():
        walk_rig(show, box, fixture or [], attribute, seconds)


@lights.command("show")
def show_rig(
    show: ShowFolder = None,
    box: BoxFile = None,
    out: Annotated[Path, typer.Option(help="The picture.")] = Path("rig.png"),
    mapping: Annotated[str | None, typer.Option(help="Heads as in this mapping. Default: the first.")] = None,
    at: Annotated[float, typer.Option(min=0.0, help="Second of the phrase that is shown.")] = 2.0,
) -> None:
    """Print the patch as a table and draw the rig: fixtures, dancer, where the heads point."""
    from appliance.lights.rig_sheet import print_rig

    with _named_options():
        print_rig(show, box, out, mapping, at)


@lights.command()
def convert(
    fixture: Annotated[
        Path, typer.Argument(help="A fixture: Open Fixture Library JSON, or .gdtf. Or a rig: .mvr.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The profile; for a rig the folder. Default: beside the file, ending with .yaml; for a rig "
            "without an ending."
        ),
    ] = None,
    mode: Annotated[
        str | None, typer.Option(help="Only this mode of a fixture. Default: all of them.")
    ] = None,
) -> None:
    """Turn a fixture (Open Fixture Library, GDTF) into a profile, or a rig (MVR) into profiles and a list.

    Profiles go into the folder `profiles` of a show. GDTF and MVR need `pip install bunraku[gdtf]`.
    """
    from appliance.fixture_library.convert import convert_file

    convert_file(fixture, out, mode)


@contextlib.contextmanager
def _named_options() -> Iterator[None]:
    """A name that the rig does not have is told as the option's fault."""
    from appliance.lights.unknown_name import UnknownNameError

    try:
        yield
    except UnknownNameError as error:
        raise typer.BadParameter(str(error), param_hint=error.option) from None
