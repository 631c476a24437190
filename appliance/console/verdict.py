"""The one sentence at the top of the page: which it is, and what it names. The worst comes first."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from appliance.levers.status import Status

_RECENT_S = 60.0  # a late tick stays in the verdict for this long

Level = Literal["well", "held", "warning", "fault"]


class Verdict(NamedTuple):
    """key: of the sentence in the table of words; values: what it names."""

    level: Level
    key: str
    values: dict[str, Any]


def verdict(
    frames: str,
    status: Status | None,
    sensors: Sequence[dict[str, Any]],
    fallbacks: Sequence[dict[str, Any]],
    since: float,
    trouble: str,
    saw_late: bool = True,
) -> Verdict:
    """The verdict on the box at this moment; `since`: no tick was late after it, Unix seconds.

    saw_late: the last late tick came at `since`. A page that has just started knows only of none since.
    """
    if frames != "fresh":
        return Verdict("fault", "stage_absent" if frames == "absent" else "stage_hung", {})
    if trouble or status is None:
        return Verdict("fault", "no_control", {"trouble": trouble})
    worn = [sensor for sensor in sensors if sensor["is_worn"]]
    missing = [sensor["name"] for sensor in worn if not sensor["heard"]]
    counts = {"heard": len(worn) - len(missing), "worn": len(worn)}
    if status.panic or status.blackout:
        return Verdict("held", "panic" if status.panic else "blackout", counts)
    if status.state == "stopped":
        return Verdict("held", "stopped", counts)
    if missing:
        return Verdict("warning", "sensors_missing", {**counts, "names": ", ".join(missing)})
    if active := [one for one in fallbacks if one["active"]]:
        return Verdict("warning", "fallbacks", {**counts, "message": active[0]["message"]})
    if status.level <= 0.0:
        return Verdict("held", "dark", counts)
    late = status.late + status.skipped
    if late and saw_late and time.time() - since < _RECENT_S:
        return Verdict("warning", "late", {"late": late, "since": since})
    key = "well" if worn else "well_alone"
    return Verdict("well", key, {**counts, "rate": round(status.rate_hz, 1), "since": since})
