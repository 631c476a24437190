"""`bunraku duet`: a show's partner, trained and measured. The app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.show.bundle import named_show
from appliance.studio.clear_errors import clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
@reading_options
def duet(
    recordings: Annotated[Path, typer.Argument(help="Folder with recordings of couples, two of each take.")],
    show: Annotated[
        Path, typer.Option(callback=named_show, help="Show with improviser.onnx; partner.onnx lies there.")
    ],
    minutes: Annotated[
        float, typer.Option(min=0.0, help="Train partner.onnx for so long first. 0: measure the show's.")
    ] = 0.0,
    steps: Annotated[int, typer.Option(min=0, help="Training steps, instead of --minutes.")] = 0,
    seconds: Annotated[float, typer.Option(min=10.0, help="Length of each duet.")] = 30.0,
    seed: Annotated[int, typer.Option(help="The same seed gives the same duets.")] = 1,
    out: Annotated[
        Path | None, typer.Option(help="The figures as JSON; beside it a PNG of the first couple.")
    ] = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Measure how a show's partner answers, on couples that it never saw, beside products that do not.

    Both recordings of a take are a couple: catalogue.yaml says which belong together and which are held out.
    """
    with clear_errors("duet"):
        from appliance.studio.partner.measure import DuetOptions, run
        from appliance.studio.train_command import choose_device

        options = DuetOptions(recordings, show, minutes, steps, seconds, seed, out, reading)
        run(options, choose_device("auto"))
