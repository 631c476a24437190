"""`bunraku vary`: variations of a phrase. Its app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.idle_options import refuse_idle
from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.clear_errors import clear_errors
from appliance.studio.model_or_show import OfRegion, OfShow, require_either

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
@reading_options
def vary(
    context: typer.Context,
    phrase: Annotated[
        Path | None,
        typer.Argument(help="BVH of the phrase; left out with --free.", show_default="the phrase of --show"),
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="checkpoint.pt of bunraku train --model sequence.")
    ] = None,
    show: OfShow = None,
    out: Annotated[
        Path, typer.Option(help="Folder for the variations, their strip and their figures.")
    ] = Path("out/variations"),
    sigma: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=10.0,
            help="How far: 0 the phrase itself, 0.5 subtle, 1 to 2 inventive, beyond 3 it may break.",
            show_default="0.5, with --free 1",
        ),
    ] = None,
    count: Annotated[int, typer.Option(min=1, max=64, help="How many variations.")] = 8,
    seed: Annotated[int, typer.Option(help="Of the first variation; each has the next one.")] = 1,
    start: Annotated[float, typer.Option(min=0.0, help="Second of the phrase to begin at.")] = 0.0,
    seconds: Annotated[float, typer.Option(min=0.5, max=120.0, help="How much of it to vary.")] = 10.0,
    mix: Annotated[
        Path | None, typer.Option(help="BVH of another phrase to mix in, instead of noise.")
    ] = None,
    share: Annotated[float, typer.Option(min=0.0, max=1.0, help="How much of --mix.")] = 0.5,
    region: OfRegion = None,
    free: Annotated[bool, typer.Option("--free", help="Samples from the prior, without a phrase.")] = False,
    on_map: Annotated[
        Path | None,
        typer.Option(help="checkpoint.pt of a pose model: draws the variations as paths over its map."),
    ] = None,
    same_timing: Annotated[
        bool, typer.Option("--same-timing", help="Gestures come when they come in the phrase.")
    ] = False,
    recordings: Annotated[
        Path | None, typer.Option(help="Folder with the dancer's BVH recordings, if they have moved.")
    ] = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Make variations of a phrase: other timing and expression, or something new with an element kept.

    The phrase becomes a point of a model that knows what this dancer does in two and a half seconds; noise
    moves the point ('Beyond Imitation'). Each variation is a BVH file that plays in a show. With --show the
    show's own network does it at once, without a training.
    """
    require_either(context, model, show)
    if (phrase is not None and free) or (phrase is None and not free and show is None):
        raise typer.BadParameter("Give a PHRASE, or --free for samples without one.")
    if free:
        refuse_idle(
            context, ("mix", "share", "region", "start", "seconds", "same_timing"), "without a PHRASE"
        )
    if mix is None:
        refuse_idle(context, ("share",), "without --mix")
    else:
        noise = ("sigma", "count", "seed", "same_timing")
        refuse_idle(context, noise, "with --mix, which makes one dance and has no noise")
    with clear_errors("vary"):
        from appliance.studio.variations.vary import VaryOptions, run

        run(
            VaryOptions(
                model=model,
                show=show,
                is_free=free,
                out=out,
                phrase=phrase,
                recordings=recordings,
                sigma=(1.0 if free else 0.5) if sigma is None else sigma,
                count=count,
                seed=seed,
                start=start,
                seconds=seconds,
                mix=mix,
                share=share,
                regions=tuple(region or ()),
                on_map=on_map,
                keeps_timing=same_timing,
                reading=reading,
            )
        )
