"""From the box file's entries to universes on open wires."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from appliance.outputs.dmx.pace import Universe
from appliance.show.dmx import DmxConfig


def open_universes(configs: Sequence[DmxConfig], state: Path | None = None) -> tuple[Universe, ...]:
    """All universes of a box, in the order of its box file. Never raises: a wire that is not there says so.

    state: the box's state folder; it keeps the identity by which sACN receivers know this box again.
    """
    raise NotImplementedError
