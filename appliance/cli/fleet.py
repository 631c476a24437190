"""`bunraku fleet`: the boxes in this network, and one show for several of them."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import tempfile
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlsplit

import typer

from appliance.cli.console import devices_file_made
from appliance.cli.options import SHOW_OR_NAME, ThisBoxFile, command_group
from appliance.console.fleet import asked, browsed
from appliance.console.push import NEEDS_PIN, PASSES, TAKEN, Neighbour, Passes, push
from appliance.release.installed_box import box_here
from appliance.release.packed_show import pack_show
from appliance.show.box import load_box
from appliance.show.bundle import named_show
from appliance.stage.stage_error import StageError

_PORT = 8080  # where an address has none

fleet = command_group("List the boxes in this network, and send a show to several of them.", True)


@fleet.command("list")
def list_boxes() -> None:
    """List the boxes that announce themselves here, each with its verdict, show and release."""

    async def reported() -> list[dict[str, Any]]:
        return await asked(await browsed())

    try:
        boxes = asyncio.run(reported())
    except OSError as error:
        raise StageError(str(error)) from None
    for one in boxes:
        verdict = one.get("verdict", {"key": "does_not_answer"})["key"].replace("_", " ")
        print("  ".join(filter(None, (one["host"], one["origin"], verdict, one.get("show"), one["version"]))))


@fleet.command("push")
def push_show(
    show: Annotated[Path, typer.Argument(callback=named_show, help=SHOW_OR_NAME)],
    to: Annotated[
        list[str], typer.Option(help="A box: its name in `bunraku fleet list`, or its address; repeat it.")
    ],
    box: ThisBoxFile = None,
) -> None:
    """Send a show to boxes. Each checks it, and dances it at once, or from its next power-on if a show goes.

    It asks for the PIN of a box that does not know this one yet. Status 1: not all have taken it.
    """
    passes = Passes(devices_file_made(load_box(box_here(box))).parent / PASSES)
    found: list[Neighbour] = []
    with contextlib.suppress(OSError):  # without avahi an address will do
        found = asyncio.run(browsed())
    name = socket.gethostname()
    states = []
    with tempfile.TemporaryDirectory() as folder:
        packed = Path(folder) / "show.zip"
        try:
            pack_show(show, packed)
        except OSError as error:
            raise StageError(f"{show}: the show cannot be packed ({error.strerror}).") from error
        for one in (_meant(given, found) for given in to):
            pushed = asyncio.run(push(one, packed, passes, "", name))
            if pushed.state == NEEDS_PIN:
                pin = typer.prompt(f"{pushed.message} PIN of {one.host}".strip())
                pushed = asyncio.run(push(one, packed, passes, pin, name))
            print(f"{one.host}: {pushed.state}. {pushed.message}")
            states.append(pushed.state)
    raise typer.Exit(0 if all(one == TAKEN for one in states) else 1)


def _meant(given: str, found: list[Neighbour]) -> Neighbour:
    """A box that was found, or the one at an address like 192.168.0.21 or https://192.168.0.21:8443."""
    if known := next((one for one in found if given in (one.host, one.name)), None):
        return known
    try:
        at = urlsplit(given if "//" in given else f"http://{given}")
        host, port = at.hostname or "", at.port or _PORT
    except ValueError:
        host = ""
    if not host:
        raise typer.BadParameter(f"'{given}' is no box and no address")
    return Neighbour(host, host, host, port, scheme="https" if at.scheme == "https" else "http")
