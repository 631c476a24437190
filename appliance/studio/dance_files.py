"""The files of a generated dance: the recording, and beside it its report and its picture."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from appliance.pictures.filmstrip import draw_filmstrip
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.pose.whole_file import write_text_whole, written_whole
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
    with written_whole(out) as beside:
        write_bvh(beside, dance, digits=PHRASE_DIGITS)


def write_report(path: Path, report: object) -> None:
    """JSON; paths are written as text, figures that could not be measured as null."""
    text = json.dumps(_without_nan(report), indent=1, default=str, allow_nan=False)
    write_text_whole(path, text + "\n")


def _without_nan(value: Any) -> Any:
    """The same with None in place of what JSON has no word for."""
    if isinstance(value, Mapping):
        return {name: _without_nan(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
