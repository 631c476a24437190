"""The last admission, kept in memory: a stage that comes back on the same machine need not measure again."""

from __future__ import annotations

import contextlib
import json
from dataclasses import asdict
from pathlib import Path

from appliance.box.record import Record
from appliance.pose.foreign_file import plain_json
from appliance.show.box import BoxConfig
from appliance.stage.admission import Admission
from appliance.stage.stage_parts import StageParts, measure_admission, warm_up

_LARGEST = 4096


def admitted(folder: Path, parts: StageParts, box: BoxConfig, comes_back: bool) -> Admission:
    """Measure what fits the tick's budget; a stage that `comes_back` takes what was measured before it.

    It takes what was measured with the same network, iterations, hands, budget and priority, since the
    machine was switched on: the folder is one in memory.
    """
    record = admission_record(parts, box)
    before = _read(record, folder) if comes_back else None
    if before is not None:
        warm_up(parts, before)
        return before
    measured = measure_admission(parts, box)
    with contextlib.suppress(OSError), contextlib.closing(record.writer(folder)) as block:
        block.write(json.dumps(asdict(measured)).encode())
    return measured


def admission_record(parts: StageParts, box: BoxConfig) -> Record:
    """The measurement, as a record whose scope is all that it depends on."""
    path = parts.network.path.resolve()
    network = path.stat()
    scope = {
        "network": [str(path), network.st_size, network.st_mtime_ns],
        "iterations": [one.iterations.wished for one in parts.puppets],
        "hands": [[hand.joint for hand in one.hands.puppeteers] for one in parts.puppets],
        "budget_ms": box.limits.tick_budget_ms,
        "priority": box.realtime.priority if box.realtime.enabled else None,
    }
    return Record("admission", "admission", _LARGEST, json.dumps(scope).encode())


def _read(record: Record, folder: Path) -> Admission | None:
    with contextlib.closing(record.reader(folder)) as block:
        try:
            return Admission(**plain_json(block.read() or b""))
        except (ValueError, TypeError):
            return None
