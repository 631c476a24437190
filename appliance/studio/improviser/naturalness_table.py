"""Generated dances beside the recordings that their networks learned from, as a table for people."""

from __future__ import annotations

from collections.abc import Mapping

from rich.box import SIMPLE_HEAD
from rich.table import Table

from appliance.studio.improviser.naturalness import Naturalness

COLUMNS = ("above 8 Hz", "longest still", "speed", "breadth", "strangeness", "slide", "float", "seam")


def naturalness_table(dances: Mapping[str, Naturalness]) -> Table:
    """A row for each dance by name, and the recordings' own last; docs/variations.md says what each is."""
    table = Table(title="How natural: the recordings' own figures below", box=SIMPLE_HEAD)
    table.add_column(no_wrap=True)
    for name in COLUMNS:
        table.add_column(name, justify="right")
    for name, one in dances.items():
        pace, likeness, seam = one.pace, one.likeness, one.seam
        table.add_row(
            name.replace("_", " "),
            f"{pace.trembling:.1%}",
            f"{pace.longest_still_s:.1f} s",
            f"{one.liveliness:.2f}",
            f"{likeness.breadth:.2f}",
            f"{likeness.strangeness:.2f}",
            f"{one.slide_cm_s:.0f} cm/s",
            f"{one.float_cm:.1f} cm",
            "" if seam is None else f"{seam.degrees:.1f}°",
        )
    any_of_them = next(iter(dances.values()))
    pace, still = any_of_them.recorded_pace, f"{any_of_them.recorded_pace.longest_still_s:.1f} s"
    slide, floating = f"{any_of_them.recorded_slide_cm_s:.0f} cm/s", f"{any_of_them.recorded_float_cm:.1f} cm"
    table.add_row("recordings", f"{pace.trembling:.1%}", still, "1.00", "1.00", "1.00", slide, floating, "")
    return table
