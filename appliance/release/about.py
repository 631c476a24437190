"""This box, described for people: which show dances and which would instead, its release, its addresses."""

from __future__ import annotations

import socket
from importlib.metadata import version
from pathlib import Path
from typing import Any

from appliance.box.served import addresses
from appliance.release.choice import Choice

HOME = Path("/opt/bunraku")


def about(chosen: Path | None, box: Path | None, home: Path = HOME) -> dict[str, Any]:
    """For JSON. chosen: what the preflight chose; box: the box file; home: where releases are installed.

    shows: id, source and `good` (has danced on this box) of what dances and then of what would dance instead,
    in this order; refused, aside: sentences on what was found and is not danced; releases: those
    installed, oldest first; release: the folder's name of the one that dances, None where none is installed.
    """
    choice = None if chosen is None else Choice.read(chosen)
    if choice is not None:
        box = choice.first.box
    return {
        "shows": [{"id": one.id, "source": one.source, "good": one.good} for one in choice.pairs]
        if choice
        else [],
        "refused": list(choice.refused) if choice else [],
        "aside": [one.message for one in choice.aside] if choice else [],
        "box_file": None if box is None else str(box),
        "version": version("bunraku"),
        "release": current.resolve().name if (current := home / "current").is_dir() else None,
        "releases": releases(home),
        "host": socket.gethostname(),
        "addresses": addresses(),
    }


def releases(home: Path) -> list[str]:
    """Names of the installed releases, in the order in which they were installed."""
    found = []
    for path in home.glob("releases/*/number"):
        name = path.parent.name
        if name != "current" and not name.endswith(".part"):
            try:
                found.append((int(path.read_text()), name))
            except (OSError, ValueError):
                continue  # the installer clears away what is not whole
    return [name for _, name in sorted(found)]
