"""The last admission, kept in memory: a stage that comes back on the same machine need not measure again."""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

from appliance.pose.foreign_file import kept_json
from appliance.show.box import BoxConfig
from appliance.show.show import Show
from appliance.stage.admission import Admission
from appliance.stage.stage_parts import StageParts, admission, warm_up

FILE = "admission.json"


def admitted(folder: Path, cast: StageParts, show: Show, box: BoxConfig, comes_back: bool) -> Admission:
    """Measure what fits the tick's budget; a stage that `comes_back` takes what was measured before it.

    It is what was measured with the same network, iterations, hands, budget and priority, since the machine
    was switched on: the folder is one in memory.
    """
    asked = _asked(show, box)
    before = _remembered(folder / FILE, asked) if comes_back else None
    if before is not None:
        warm_up(cast, show, before)
        return before
    measured = admission(cast, show, box)
    with contextlib.suppress(OSError):
        _remember(folder / FILE, asked, measured)
    return measured


def _asked(show: Show, box: BoxConfig) -> dict[str, Any]:
    """What an admission depends on."""
    network, dancer = show.network.stat(), show.config.dancer
    return {
        "network": [str(show.network.resolve()), network.st_size, network.st_mtime_ns],
        "iterations": [dancer.coding_iterations, dancer.interaction_iterations],
        "hands": [hand.joint for hand in show.config.hands],
        "budget_ms": box.limits.tick_budget_ms,
        "priority": box.realtime.priority if box.realtime.enabled else None,
    }


def _remembered(path: Path, asked: dict[str, Any]) -> Admission | None:
    try:
        kept = kept_json(path)
        return Admission(**kept["measured"]) if kept["asked"] == asked else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _remember(path: Path, asked: dict[str, Any], measured: Admission) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(json.dumps({"asked": asked, "measured": asdict(measured)}), encoding="utf-8")
    temporary.rename(path)
