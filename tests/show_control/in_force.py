"""What show control has left in force in a runtime folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from appliance.box.show_state import ShowStateReader
from appliance.levers.lever import Lever
from appliance.levers.show_state import ShowState


def show_state(folder: Path) -> ShowState:
    return ShowStateReader(folder).read()


def declared(folder: Path, lever: Lever[Any]) -> tuple[Any, float] | None:
    """Value and seconds of a lever; None: it was not set."""
    state = show_state(folder)
    return (state[lever].value, state[lever].seconds) if lever in state else None
