"""Commands of the two distributions beside the box's, and the sentence where one of them is not installed."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import NamedTuple

PLUG_INS = "bunraku.commands"  # group of entry points


class Distribution(NamedTuple):
    """Its name for pip, its entry point in PLUG_INS, its commands."""

    name: str
    plug_in: str
    commands: tuple[str, ...]


DISTRIBUTIONS = (
    Distribution("bunraku-sim", "simulation", ("emulate", "measure")),
    Distribution(
        "bunraku-studio",
        "studio",
        (
            *("convert", "retarget", "import", "inspect", "train", "evaluate", "export", "experiment"),
            *("granular", "improvise", "vary", "map", "path", "explore"),
            *("duet", "compare", "periods", "compare-blind"),
        ),
    ),
)


def absent() -> list[Distribution]:
    """Those that are not installed here."""
    installed = {point.name for point in entry_points(group=PLUG_INS)}
    return [one for one in DISTRIBUTIONS if one.plug_in not in installed]


def absent_commands() -> Mapping[str, str]:
    """Commands that are not installed here, each with a sentence on how to get it."""
    return {
        command: f"'{command}' comes with {one.name}, which is not installed here. "
        f"Install it: pip install {one.name}"
        for one in absent()
        for command in one.commands
    }
