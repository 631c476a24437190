"""The roster: every sensor as the stage last saw it, as messages of the control port."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from appliance.box.roster import UNKNOWN_S as UNKNOWN_S
from appliance.box.roster import RosterLine as RosterLine
from appliance.show_control.packet import Message

SENSOR, END = "/sensors/sensor", "/sensors/end"


def roster_messages(health: Mapping[str, Any], key_file: str, now: float) -> Iterator[Message]:
    """The answer to `/sensors/list`: a message for each sensor, and one to end with.

    `health` as the stage wrote it; empty while it starts.
    """
    lines = [RosterLine(*line) for line in health.get("sensors", ())]
    for line in lines:
        yield SENSOR, *line
    looked_at = health.get("looked_at")
    # The stage may have looked after this process read its clock.
    age_s = UNKNOWN_S if looked_at is None else max(0.0, now - float(looked_at))
    yield END, len(lines), age_s, key_file
