"""The bar for a learned dancer: figures, bounds and null products. Its show is offered only above it.

The bounds are those at which `bunraku train` begins to give advice. Beside them are the figures of the dancer
that comes with the box, and of a null product that fails: a network that copies the phrase, a phrase with the
hand's joint pasted on, the mean pose.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

from appliance.pose.foreign_file import stored_json
from appliance.show.bundle import default_show_path


class Bound(NamedTuple):
    """key: in a joint's figures; null: what null_name has there, where the report does not measure it."""

    name: str
    key: str
    least: float | None
    most: float | None
    null_name: str
    null: float


BOUNDS = (
    Bound("answer (degrees)", "answer", 8.0, None, "a copy", 0.0),
    Bound("plausibility", "plausibility", None, 1.1, "pasted on", 1.19),
    Bound("speed of the legs", "energy_legs", 0.75, 1.35, "the mean pose", 0.0),
    Bound("speed of the free arms", "energy_arms", 0.75, 1.35, "the mean pose", 0.0),
    Bound("spread of the legs", "spread_legs", 0.7, None, "the mean pose", 0.0),
    Bound("roughness", "roughness", None, 1.5, "the phrase", 1.0),
    Bound("critic", "critic", None, 0.9, "the mean pose", 1.0),
)
ERROR = Bound("degrees off the recordings", "1", None, 10.0, "the mean pose", 22.1)
IN_PLAY = "10_9"


def figures_of(report: dict[str, Any]) -> list[dict[str, Any]]:
    """Each figure of a show's report beside its bound, the default show's and a null product's.

    Raises KeyError or TypeError where the report has none: nothing was measured.
    """
    usual, held = _default(), _held(report)
    rows = [_row(ERROR, report["degrees"]["1"]["mean"], usual["degrees"]["1"]["mean"], None)]
    pasted = held.get("baselines", {}).get("pasted", {})
    for bound in BOUNDS:
        if bound.key == "critic" and held[IN_PLAY].get("critic") is None:
            continue  # on a slow machine too little is danced for a critic: the other figures decide
        null = pasted.get(bound.key) if bound.null_name == "pasted on" else None
        rows.append(_row(bound, held[IN_PLAY].get(bound.key), _held(usual)[IN_PLAY][bound.key], null))
    return rows


def sentence_of(figures: list[dict[str, Any]]) -> str:
    """Whether all bounds hold; else which do not."""
    failed = [f"{one['name']} {one['value']} ({one['bound']})" for one in figures if not one["holds"]]
    if not failed:
        return "It reaches the bar: its show is offered."
    return f"It does not reach the bar: {', '.join(failed)}. The show that danced before stays."


def _held(report: dict[str, Any]) -> dict[str, Any]:
    """The figures of the first joint that was held."""
    puppetry = report["puppetry"]
    if "not_measured" in puppetry:
        raise KeyError(puppetry["not_measured"])
    found: dict[str, Any] = next(one for one in puppetry.values() if isinstance(one, dict) and IN_PLAY in one)
    return found


def _row(bound: Bound, value: float | None, usual: float, null: float | None) -> dict[str, Any]:
    """value None: it could not be measured, so it does not hold."""
    edges = []
    if bound.least is not None:
        edges.append(f"at least {bound.least:g}")
    if bound.most is not None:
        edges.append(f"at most {bound.most:g}")
    holds = value is not None and (bound.least or 0.0) <= value <= (bound.most or math.inf)
    return {
        "name": bound.name,
        "value": "not measured" if value is None else round(value, 2),
        "holds": holds,
        "bound": ", ".join(edges),
        "default": round(usual, 2),
        "null_name": bound.null_name,
        "null": round(bound.null if null is None else null, 2),
    }


@cache
def _default() -> dict[str, Any]:
    """The report of the show that comes with the box."""
    report: dict[str, Any] = stored_json(default_show_path() / "report.json")
    return report
