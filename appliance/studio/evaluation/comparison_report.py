"""The figures of the held dance beside those of its baselines, as a table for people."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

# Figure, text, digits; the text says what is good.
ROWS = (
    ("critic", "critic, whole body (0.5: as the dancer)", 2),
    ("critic_legs", "critic, legs", 2),
    ("critic_moving", "critic that sees speed and jerk too", 2),
    ("spread_legs", "spread: legs (1: the phrase's)", 2),
    ("spread_trunk", "spread: trunk", 2),
    ("spread_arms", "spread: free arms", 2),
    ("spread_held_limb", "spread: rest of the held limb", 2),
    ("energy_legs", "energy: legs (1: the phrase's)", 2),
    ("energy_trunk", "energy: trunk", 2),
    ("energy_arms", "energy: free arms", 2),
    ("energy_held_limb", "energy: rest of the held limb", 2),
    ("coupling_fidelity", "coupling to the hand (1: the recordings')", 2),
    ("held", "held joint off the hand, degrees", 1),
    ("off_phrase", "others off the phrase, degrees", 1),
    ("fit", "fit, degrees", 1),
    ("plausibility", "plausibility", 2),
    ("masked", "off what the hand's take did, degrees", 1),
    ("masked_nearest", "the same of the nearest recorded pose", 1),
    ("memorisation", "memorisation (0: one recorded moment)", 2),
    ("coverage", "coverage of the dancer", 2),
    ("recall", "recall", 2),
    ("fid_kinetic", "FID, kinetic", 1),
    ("fid_geometric", "FID, geometric", 1),
    ("jerk", "jerk, m/s3", 0),
    ("foot_skate_ratio", "foot-skate ratio", 3),
    ("pfc_ratio", "PFC, against the phrase's", 2),
)


def comparison_table(found: dict[str, Any], joints: Sequence[str]) -> Table | None:
    """Means over the joints held, a column for each baseline; None if nothing was compared."""
    compared = [found[joint]["baselines"] for joint in joints if "baselines" in found[joint]]
    if not compared:
        return None
    kinds = [kind for kind in compared[0] if all(kind in one for one in compared)]
    made = Table(
        title=f"Is the held dance alive? Means over hands on {', '.join(joints)}",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    made.add_column("figure")
    for kind in kinds:
        made.add_column(kind, justify="right")
    for name, text, digits in ROWS:
        cells = [_mean([one[kind][name] for one in compared], digits) for kind in kinds]
        if any(cells):
            made.add_row(text, *cells)
    return made


def comparison_sentences(found: dict[str, Any]) -> list[str]:
    """Reference values for the distances between sets of dances, and the dance without a hand."""
    lines = []
    ends = found.get("reference", {})
    for kind in ("kinetic", "geometric"):
        floor, ceiling = (ends.get(f"fid_{kind}_{end}") for end in ("floor", "ceiling"))
        if floor is not None:
            other = "" if ceiling is None else f", of another dancer {ceiling:.1f}"
            lines.append(f"FID, {kind}, of the recordings against each other {floor:.1f}{other}.")
    for coding, row in found.get("free", {}).items():
        if row.get("critic") is not None:
            lines.append(
                f"Without a hand, after {coding} iterations: critic {row['critic']:.2f}, legs "
                f"{_shown(row.get('critic_legs'))}, with speed and jerk {_shown(row.get('critic_moving'))}; "
                f"energy of the legs {_shown(row.get('energy_legs'))}."
            )
    return lines


def _mean(values: Sequence[float | None], digits: int) -> str:
    known = [value for value in values if value is not None]
    return f"{statistics.fmean(known):.{digits}f}" if known else ""


def _shown(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f}"
