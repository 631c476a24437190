"""Names of levers/sources.py, for the rooms that import them from here still."""

from __future__ import annotations

from appliance.levers.sources import (
    GRANULAR,
    IMPROVISE,
    KEPT,
    LIVE,
    MADE,
    MAIN,
    MOST_POINTS,
    NO_CARD,
    PARAMETERS,
    PATH,
    POINTS,
    SEEDS,
    VARY,
    Parameter,
)

__all__ = [
    "GRANULAR",
    "IMPROVISE",
    "KEPT",
    "LIVE",
    "MADE",
    "MAIN",
    "MOST_POINTS",
    "NO_CARD",
    "PARAMETERS",
    "PATH",
    "POINTS",
    "SEEDS",
    "VARY",
    "Parameter",
]
