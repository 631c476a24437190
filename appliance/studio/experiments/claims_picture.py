"""The report of the experiments as one picture: the excerpts, and the paper's claims with all figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from appliance.studio.evaluation.pictures import FAINT, INK, PANEL, new_figure, save
from appliance.studio.experiments.claims import Claim, worth

WIDTH, CLAIM_SHARE = 15.0, 0.34  # inches; of the width for the claim's words
ROW, HEAD = 0.84, 0.5  # inches
FIGURES = 4  # at most in a field
COLOURS = {True: "#2f5a3a", False: "#6e2a1f", None: PANEL}  # holds, does not, is not spoken of


def draw_claims(
    path: Path,
    title: str,
    networks: Mapping[str, Sequence[Claim]],
    excerpts: Path,
    nulls: Mapping[str, Sequence[Claim]],
) -> Path:
    """excerpts: their strip, a PNG. For each network a table: claims by excerpts, green where they hold.

    nulls: the claims of networks that know nothing; each row marks those that pass.
    """
    import matplotlib.image

    strip = matplotlib.image.imread(excerpts)
    heights = [WIDTH * strip.shape[0] / strip.shape[1]]
    heights += [2 * HEAD + ROW * len(claims) for claims in networks.values()]
    figure = new_figure(WIDTH, sum(heights) + HEAD)
    figure.suptitle(title, color=INK, fontsize=15, x=0.01, ha="left")
    rows = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    axes = figure.add_subplot(rows[0])
    axes.imshow(strip, interpolation="antialiased")
    axes.set_axis_off()
    for number, (name, claims) in enumerate(networks.items(), 1):
        _table(figure.add_subplot(rows[number]), name, claims, nulls)
    return save(figure, path)


def _table(axes: Any, name: str, claims: Sequence[Claim], nulls: Mapping[str, Sequence[Claim]]) -> None:
    from matplotlib.patches import Rectangle

    names = list(dict.fromkeys(excerpt for claim in claims for excerpt in claim.figures))
    width = (1 - CLAIM_SHARE) / len(names)
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(len(claims) + HEAD / ROW, -HEAD / ROW)
    axes.set_title(f"{name}: green where the claim holds, red where not", color=INK, loc="left", fontsize=11)
    for column, excerpt in enumerate(names):
        axes.text(CLAIM_SHARE + (column + 0.5) * width, -0.3, excerpt, color=FAINT, fontsize=10, ha="center")
    for row, claim in enumerate(claims):
        drawn = _drawn(claim)
        text = fill(f"({claim.letter}) {claim.text}", 70)
        axes.text(0, row + 0.06, text, color=INK, fontsize=9.5, va="top")
        measured = " / ".join(name.replace("_", " ") for name in drawn)
        axes.text(0, row + 0.92, f"{measured}\n{worth(claim, nulls)}", color=FAINT, fontsize=8.5, va="bottom")
        for column, excerpt in enumerate(names):
            figures = claim.figures.get(excerpt)
            if figures is None:
                continue
            left = CLAIM_SHARE + column * width
            colour = COLOURS[claim.holds.get(excerpt)]
            axes.add_patch(Rectangle((left + 0.003, row + 0.06), width - 0.006, 0.86, color=colour))
            said = " / ".join(_short(figures[name]) for name in drawn)
            axes.text(left + width / 2, row + 0.5, said, color=INK, fontsize=9, ha="center", va="center")


def _drawn(claim: Claim) -> list[str]:
    """Names of the figures that a field has room for: all of four, else those with a bound."""
    names = list(next(iter(claim.figures.values())))
    return names if len(names) <= FIGURES else [bound.figure for bound in claim.bounds]


def _short(value: float) -> str:
    """Two digits, or '-' where there is nothing to measure."""
    return "-" if not math.isfinite(value) else f"{value:.0f}" if abs(value) >= 10 else f"{value:.2g}"
