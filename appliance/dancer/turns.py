"""Turns: which of two dancers leads, in stretches of eight seconds."""

from __future__ import annotations

import math

STRETCH_TICKS = 400
_SPREAD = (math.sqrt(5) - 1) / 2  # golden ratio: seeds near each other begin in different places


def answerer_leads(tick: int, lead: float, seed: int = 0) -> bool:
    """Whether the dancer that answers leads at this tick; over many stretches it does for a share `lead`."""
    stretch, begins = tick // STRETCH_TICKS, seed * _SPREAD % 1.0
    return math.floor(begins + (stretch + 1) * lead) > math.floor(begins + stretch * lead)
