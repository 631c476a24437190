"""Checkpoints: the newest on the disk, and one whose puppet is somewhere else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from appliance.box.checkpoint import Checkpoint, Standing, read_checkpoints

OF_PUPPET = frozenset(Standing._fields)


def read_checkpoint(path: Path) -> Checkpoint | None:
    """The newest whole place on the disk; None where there is none."""
    return next(iter(read_checkpoints(path)[0]), None)


def moved(place: Checkpoint, **changes: Any) -> Checkpoint:
    """The place with other values: of its puppet those that a Standing has, of the show the others."""
    of_puppet = {name: value for name, value in changes.items() if name in OF_PUPPET}
    of_show = {name: value for name, value in changes.items() if name not in OF_PUPPET}
    return replace(place, puppets=tuple(one._replace(**of_puppet) for one in place.puppets), **of_show)
