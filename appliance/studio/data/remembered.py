"""How the recordings of a trained network were read: kept in its checkpoint and in its show's report."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from appliance.pose.reading_options import ReadingOptions
from appliance.studio.data.catalogue import READ_FROM_FILES, Catalogue

KEY = "recordings_read"  # of report.json


def reading_facts(catalogue: Catalogue) -> dict[str, Any]:
    """What a show keeps of how its recordings were read: only what was said, by pattern."""
    return {name: value for name in READ_FROM_FILES if (value := getattr(catalogue, name))}


def remembered_reading(network: Path) -> ReadingOptions:
    """For other recordings of the dancer of a show folder, a network in one, or a checkpoint; else empty."""
    folder = network if network.is_dir() else network.parent
    if network.suffix == ".pt":
        from appliance.studio.evaluation.coders import load_state

        origin = load_state(network).get("origin") or {}
        return _options(origin.get("catalogue") or {})
    try:
        report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return ReadingOptions()
    return _options(report.get(KEY) or {} if isinstance(report, dict) else {})


def _options(facts: Mapping[str, Any]) -> ReadingOptions:
    known: dict[str, Any] = {name: dict(facts.get(name) or {}) for name in READ_FROM_FILES}
    return ReadingOptions(**known)
