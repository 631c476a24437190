"""`bunraku experiment`: the experiments of 'Puppeteering an AI'. Its app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.show.bundle import default_show_path, named_show
from appliance.studio.clear_errors import clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
@reading_options
def experiment(
    out: Annotated[
        Path, typer.Option(help="Folder for the page, the strips, the BVH and the figures.")
    ] = Path("out/experiment"),
    show: Annotated[
        Path | None,
        typer.Option(
            callback=named_show, help="Show whose network dances. Default: the show that comes with the box."
        ),
    ] = None,
    recordings: Annotated[
        Path | None,
        typer.Option(
            help="Folder that the excerpts come from, takes kept apart first. Default: the show's phrase."
        ),
    ] = None,
    excerpts: Annotated[
        Path | None, typer.Option(help="YAML that names them: `still: {take: salsa_09, start: 12.5}`.")
    ] = None,
    network: Annotated[
        list[Path] | None,
        typer.Option(
            help="Another network of this dancer beside it (show, checkpoint.pt, puppet.onnx); repeatable."
        ),
    ] = None,
    joint: Annotated[
        list[str] | None,
        typer.Option(
            help="What the hand holds; repeatable: all are kept, the first is turned and led.",
            show_default="the left upper arm",
        ),
    ] = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            help="CSV of a worn sensor: seconds, w, x, y, z. Default: how the liveliest excerpt moves it."
        ),
    ] = None,
    pictures: Annotated[bool, typer.Option(help="Draw the filmstrips, most of the time it takes.")] = True,
    *,
    reading: ReadingOptions,
) -> None:
    """Dance the experiments of 'Puppeteering an AI' and hold what comes out against the paper's claims.

    Five excerpts of 200 frames, chosen by measure; coding iterations 1 to 10; one joint kept, turned, led by
    a sensor and held still. Out come a page that opens without a network, filmstrips, BVH, experiments.json.
    """
    with clear_errors("experiment"):
        from appliance.studio.experiments.experiment import ExperimentOptions, run

        run(
            ExperimentOptions(
                show=show or default_show_path(),
                out=out,
                recordings=recordings,
                excerpts=excerpts,
                networks=tuple(network or ()),
                joints=tuple(joint or ()),
                trace=trace,
                pictures=pictures,
                reading=reading,
            )
        )
