"""Generated dances beside the recordings that their networks learned from, as a table for people."""

from __future__ import annotations

from collections.abc import Mapping

from rich.box import SIMPLE_HEAD
from rich.table import Table

from appliance.studio.improviser.naturalness import Naturalness

COLUMNS = ("above", "longest", "", "", "strange-", "slide", "float", "")  # two lines: 80 columns hold them
UNDER = ("8 Hz", "still", "speed", "breadth", "ness", "cm/s", "cm", "seam")


def naturalness_table(dances: Mapping[str, Naturalness]) -> Table:
    """A row for each dance by name, and the recordings' own last; docs/variations.md says what each is."""
    table = Table(
        title="How natural: the recordings' own figures below", box=SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    table.add_column(no_wrap=True)
    for above, under in zip(COLUMNS, UNDER, strict=True):
        table.add_column(f"{above}\n{under}", justify="right", no_wrap=True)
    for name, one in dances.items():
        pace, likeness, seam = one.pace, one.likeness, one.seam
        table.add_row(
            name.replace("_", " "),
            f"{pace.trembling:.1%}",
            f"{pace.longest_still_s:.1f} s",
            f"{one.liveliness:.2f}",
            f"{likeness.breadth:.2f}",
            f"{likeness.strangeness:.2f}",
            f"{one.slide_cm_s:.0f}",
            f"{one.float_cm:.1f}",
            "" if seam is None else f"{seam.degrees:.1f}°",
        )
    any_of_them = next(iter(dances.values()))
    pace, still = any_of_them.recorded_pace, f"{any_of_them.recorded_pace.longest_still_s:.1f} s"
    slide, floating = f"{any_of_them.recorded_slide_cm_s:.0f}", f"{any_of_them.recorded_float_cm:.1f}"
    table.add_row("recordings", f"{pace.trembling:.1%}", still, "1.00", "1.00", "1.00", slide, floating, "")
    return table
