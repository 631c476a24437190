"""The files of a generated dance: the recording, and beside it its report and its picture."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from appliance.pictures.filmstrip import draw_filmstrip
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.studio.export.packing import PHRASE_DIGITS


def write_dance(out: Path, dance: Recording, title: str, report: Mapping[str, Any], rows: int) -> None:
    """A BVH file, its report as JSON, and a filmstrip of `rows` rows as PNG."""
    write_recording(out, dance)
    write_report(out.with_suffix(".json"), report)
    picture = out.with_suffix(".png")
    draw_filmstrip(picture, dance.skeleton, dance.poses, dance.roots, dance.fps, title=title, rows=rows)


def write_recording(out: Path, dance: Recording) -> None:
    """A BVH file as phrases have it, whole, in a folder that need not exist yet. Raises OSError."""
    out.parent.mkdir(parents=True, exist_ok=True)
    beside = out.with_name(f".{out.name}.part")
    try:
        write_bvh(beside, dance, digits=PHRASE_DIGITS)
        beside.replace(out)
    finally:
        beside.unlink(missing_ok=True)


def write_report(path: Path, report: Mapping[str, Any]) -> None:
    """JSON; paths are written as text."""
    path.write_text(json.dumps(report, indent=1, default=str) + "\n", encoding="utf-8")
