"""What show control has left in force in a runtime folder."""

from __future__ import annotations

from pathlib import Path

from appliance.box.show_state import ShowState, ShowStateReader


def show_state(folder: Path) -> ShowState:
    return ShowStateReader(folder).read()


def declared(folder: Path, part: str) -> tuple[object, ...]:
    """What is declared for a part of the dance: a text, and numbers; nothing before it is."""
    _, text, numbers = show_state(folder).dance.get(part, (0, "", ()))
    return (text, *numbers) if part in show_state(folder).dance else ()
