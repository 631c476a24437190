"""Journals that no box writes, and what is said of one in bounded memory and time."""

from __future__ import annotations

import contextlib
import io
import json
import resource
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.cli.app import main
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.recorder import chunks, log
from appliance.recorder.record import EVENT, TICK, layout_of

PATIENCE_S = 300.0
PEAK = 1000 << 20  # bytes on top of the test's own: what may be held, and once more while it grows


def header(whole: bytes) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(next(chunks.chunks(whole)).data)
    return found


def with_header(whole: bytes, facts: Any) -> bytes:
    _, *others = chunks.chunks(whole)
    parts = [chunks.chunk(one.kind, one.data, one.ticks) for one in others]
    return b"".join([chunks.chunk(chunks.HEADER, json.dumps(facts).encode()), *parts])


def odd_headers(whole: bytes) -> Iterator[Any]:
    facts = header(whole)
    yield from ([], {}, "run", None, 7)
    for name in facts:
        yield {other: value for other, value in facts.items() if other != name}
        yield from (facts | {name: odd} for odd in (None, [], {}, "", -1, 1e300, [[]], ["a"], {"a": 1}))
    yield facts | {"record": [*facts["record"][:-1], ["reading_numbers", "|O", [1, 8]]]}
    yield facts | {"record": [[name, form, [10**6, 10**6]] for name, form, _ in facts["record"]]}
    yield facts | {"hands": [{"joint": "nobody's", "kind": "", "sensor": None}]}


def changed_order(whole: bytes, change: Callable[[dict[str, Any]], None]) -> bytes:
    def entries(data: bytes) -> Iterator[log.Entry]:
        for one in log.unpacked(data):
            if one.kind == EVENT:
                event = json.loads(one.data)
                change(event)
                one = log.Entry(one.number, EVENT, json.dumps(event).encode())
            yield one

    return b"".join(
        chunks.chunk(one.kind, log.packed(list(entries(one.data))), one.ticks)
        if one.kind == chunks.LOG
        else chunks.chunk(one.kind, one.data, one.ticks)
        for one in chunks.chunks(whole)
    )


def many_ticks(whole: bytes, count: int) -> bytes:
    """So many ticks of zeros: a hundredth of their bytes."""
    facts, *_ = chunks.chunks(whole)
    tick_bytes = layout_of(json.loads(facts.data)).itemsize
    rows = np.zeros(
        20_000, [("number", "<u8"), ("kind", "<u4"), ("bytes", "<u4"), ("tick", f"V{tick_bytes}")]
    )
    rows["kind"], rows["bytes"] = TICK, tick_bytes
    parts = [chunks.chunk(chunks.HEADER, facts.data)]
    for first in range(1, count, len(rows)):
        rows["number"] = np.arange(first, first + len(rows))
        parts.append(chunks.chunk(chunks.LOG, rows.tobytes(), len(rows)))
    return b"".join(parts)


def listed_in_bounds(path: Path) -> str:
    """What `journal list` says of a journal, in bounded memory and time."""

    def listed() -> bytes:
        before = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
        with contextlib.redirect_stderr(io.StringIO()) as refused, pytest.raises(SystemExit):
            main(("journal", "list", "--journal", str(path), "--events"))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
        return json.dumps([refused.getvalue() or "listed", peak - before]).encode()

    message, peak = json.loads(run_with_timeout(PATIENCE_S, listed))
    assert peak < PEAK, f"{peak >> 20} MB"
    return str(message)
