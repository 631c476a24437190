"""`bunraku compare` and `bunraku periods`: dances beside each other. The app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.clear_errors import clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
@reading_options
def compare(
    teacher: Annotated[Path, typer.Argument(help="BVH of the dance as it should be.")],
    student: Annotated[Path, typer.Argument(help="BVH of another version of it, of any body.")],
    out: Annotated[Path, typer.Option(help="Folder for the pictures and figures.")] = Path("out/compare"),
    mirrored: Annotated[
        bool, typer.Option("--mirrored", help="The student faces the teacher as in a mirror.")
    ] = False,
    start: Annotated[float, typer.Option(min=0.0, help="Second of both to begin at.")] = 0.0,
    seconds: Annotated[float, typer.Option(min=2.0, max=600.0, help="How much of both.")] = 120.0,
    nulls: Annotated[
        bool, typer.Option(help="Also the teacher beside copies of itself: what the figures mean.")
    ] = True,
    *,
    reading: ReadingOptions,
) -> None:
    """Compare a student's version of a dance with the teacher's: timing and form, joint by joint.

    Both are aligned in time first, so the same dance half a second later, or a tenth faster, has the same
    form. Delay and tempo are separate figures, and the worst moments are named and drawn.
    """
    with clear_errors("compare"):
        from appliance.studio.comparison.versions import CompareOptions, run

        run(CompareOptions(teacher, student, out, mirrored, start, seconds, nulls, reading))


@app.command()
@reading_options
def periods(
    earlier: Annotated[Path, typer.Argument(help="Folder of recordings, a BVH file, or a show.")],
    later: Annotated[Path, typer.Argument(help="The same of another time.")],
    out: Annotated[Path, typer.Option(help="Folder for the pictures and figures.")] = Path("out/periods"),
    count: Annotated[int, typer.Option(min=1, max=20, help="How many movements to name on each side.")] = 6,
    *,
    reading: ReadingOptions,
) -> None:
    """Compare two periods of a practice: what each does that the other never does.

    A second of dance is new if no second of the other period is as near to it as takes of one period usually
    are to each other. The movements are listed with file and second, and drawn.
    """
    with clear_errors("periods"):
        from appliance.studio.comparison.periods import PeriodsOptions, run

        run(PeriodsOptions(earlier, later, out, count, reading))
