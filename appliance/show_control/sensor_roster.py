"""The roster: every sensor as the stage last saw it, as messages of the control port."""

from __future__ import annotations

from collections.abc import Iterator

from appliance.box.roster import Roster
from appliance.show_control.packet import Message

SENSOR, END = "/sensors/sensor", "/sensors/end"


def roster_messages(roster: Roster, key_file: str, now: float) -> Iterator[Message]:
    """The answer to `/sensors/list`: a message for each sensor, and one to end with."""
    for line in roster.lines:
        yield SENSOR, *line
    yield END, len(roster.lines), roster.age_s(now), key_file
