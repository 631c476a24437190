"""The shows that this box can play, for the page: brought to it, learned on it, or built in."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from appliance.pose.foreign_file import content
from appliance.pose.foreign_yaml import plain_values
from appliance.release.choice import CHOSEN, Choice
from appliance.show.bundle import CHECKSUMS, LARGEST_CHECKSUMS, bundled_shows

_LARGEST = 1 << 20  # bytes of a show.yaml


def shows_here(chosen: Path | None, danced: Path | None, learned: Path | None) -> list[dict[str, Any]]:
    """For JSON, the newest first, those that come with the box last, each content once.

    chosen: what the preflight chose; danced: the show on the stage; learned: the show that was learned last.
    id: a bundled show's name, else its folder; name: as its show.yaml says; since: seconds of the epoch at
    which it came, None for a bundled one; danced: whether it is on the stage.
    """
    bundled = {path: name for name, path in bundled_shows().items()}
    danced = None if danced is None else danced.resolve()
    others: list[dict[str, Any]] = []
    for folder in _places(chosen, danced, learned):
        if folder not in bundled and (name := _name(folder)):
            since = (folder / "show.yaml").stat().st_mtime
            others.append({"id": str(folder), "name": name, "since": since, "danced": folder == danced})
    seen: set[bytes | str] = set()
    found = []
    # Where two have the same content, the one on the stage is listed.
    for one in sorted(others, key=lambda one: not one["danced"]):
        if (mark := _mark(Path(one["id"]))) not in seen:
            seen.add(mark)
            found.append(one)
    found.sort(key=lambda one: -one["since"])
    return found + [
        {"id": name, "name": name, "since": None, "danced": folder == danced}
        for folder, name in bundled.items()
    ]


def _places(chosen: Path | None, danced: Path | None, learned: Path | None) -> Iterator[Path]:
    """Folders of shows, some of them twice or gone."""
    if danced is not None:
        yield danced
    if chosen is not None and (here := Choice.read(chosen)) is not None:
        # One that came during the show waits in the data folder for the next power-on.
        for choice in (Choice.read(here.data / CHOSEN), here):
            yield from (pair.show for pair in (choice.pairs if choice else ()) if pair.show_id)
    if learned is not None:
        yield learned


def _name(folder: Path) -> str:
    """ "" for what is no show."""
    try:
        said = plain_values(content(folder / "show.yaml", _LARGEST).decode())
        return str(said["name"] or "")
    except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError):
        return ""


def _mark(folder: Path) -> bytes | str:
    """The same for two folders with the same files."""
    try:
        return content(folder / CHECKSUMS, LARGEST_CHECKSUMS)
    except OSError:
        return str(folder)
