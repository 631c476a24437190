"""Benchmarks as ratios: each against the references of its own group, medians of one run."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Figure:
    """Median of one benchmark; a reference is what the others of its group are compared with."""

    group: str
    label: str
    median_ms: float
    is_reference: bool


def figures(benchmarks: Iterable[Any]) -> list[Figure]:
    """Results of pytest-benchmark that carry a label, in the order in which they ran."""
    return [
        Figure(
            str(one.group),
            one.extra_info["label"],
            1000.0 * one.stats.median,
            one.extra_info.get("reference", False),
        )
        for one in benchmarks
        if "label" in one.extra_info
    ]


def ratios(found: list[Figure]) -> dict[str, dict[str, dict[str, float]]]:
    """How many times faster each is than its references: group -> label -> reference -> times."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for one in found:
        references = [other for other in found if other.group == one.group and other.is_reference]
        if references and not one.is_reference:
            times = {other.label: round(other.median_ms / one.median_ms, 1) for other in references}
            table.setdefault(one.group, {})[one.label] = times
    return table


def lines(found: list[Figure]) -> list[str]:
    """The table for people, group by group."""
    text: list[str] = []
    quick = ratios(found)
    width = max((len(one.label) for one in found), default=0)
    for group in dict.fromkeys(one.group for one in found):
        text += ["", group]
        for one in (one for one in found if one.group == group):
            row = f"  {one.label:<{width}}  {one.median_ms:10.4f} ms"
            for reference, times in quick.get(group, {}).get(one.label, {}).items():
                row += f"  {times:8.1f} x {reference}"
            text.append(row)
    return text


def write(path: Path, found: list[Figure]) -> None:
    """benchmarks.json: machine, medians in milliseconds, ratios."""
    medians: dict[str, dict[str, float]] = {}
    for one in found:
        medians.setdefault(one.group, {})[one.label] = round(one.median_ms, 6)
    reported = {
        "machine": {
            "processor": platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
            "load_at_the_end": os.getloadavg()[0],
        },
        "medians_ms": medians,
        "times_faster": ratios(found),
    }
    path.write_text(json.dumps(reported, indent=1) + "\n", encoding="utf-8")
