"""`bunraku granular`: motion without a recording. Its app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.idle_options import refuse_idle
from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.clear_errors import clear_errors
from appliance.studio.model_or_show import OfRegion, OfShow

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
@reading_options
def granular(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="The phrase, a BVH file; its figures and picture lie beside it.")],
    checkpoint: Annotated[
        Path | None,
        typer.Argument(help="checkpoint.pt of a training; left out with --show.", show_default=False),
    ] = None,
    show: OfShow = None,
    recordings: Annotated[
        Path | None, typer.Option(help="Folder with the dancer's BVH recordings, if they have moved.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="How long the phrase is.")] = 30.0,
    seed: Annotated[int, typer.Option(help="Another seed, another dance.")] = 1,
    spread: Annotated[
        float, typer.Option(min=0.0, max=5.0, help="How far from the usual: 1 as in the prior; 0: one pose.")
    ] = 1.2,
    speed: Annotated[
        float,
        typer.Option(min=0.01, max=25.0, help="Most changes a second in a walk."),
    ] = 1.0,
    hop: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Ticks of 20 ms from one window to the next.",
            show_default="1, of a show's network a quarter of its window",
        ),
    ] = None,
    samples: Annotated[
        bool, typer.Option("--samples", help="Every window drawn for itself, instead of a walk.")
    ] = False,
    one: Annotated[
        str | None, typer.Option("--from", help="A take, TAKE or TAKE@SECONDS: its path instead of a walk.")
    ] = None,
    other: Annotated[str | None, typer.Option("--to", help="Another one, mixed into it.")] = None,
    mix: Annotated[float, typer.Option(min=0.0, max=1.0, help="How much of --to (encodingmix).")] = 0.5,
    offset: Annotated[
        float,
        typer.Option(min=-5.0, max=5.0, help="Moves the path, in standard deviations (encodingoffset)."),
    ] = 0.0,
    feedback: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=1.0, help="The network on its own motion, with this share of --from mixed in."
        ),
    ] = None,
    region: OfRegion = None,
    phrase: Annotated[
        Path | None,
        typer.Option(
            help="With --region: BVH that the rest of the body dances.", show_default="that of --show"
        ),
    ] = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Make an endless phrase from only a dancer's latents: Granular Dance.

    A walk through the prior (or samples, with --samples), the path between two takes, or the network fed with
    what it danced before. The phrase plays in a show as any other. With --show the show's sequence network
    does it at once, as on stage. With --region a part of the body does, and the rest dances a phrase.
    """
    if (checkpoint is None) == (show is None):
        raise typer.BadParameter(
            "Give a CHECKPOINT, or --show, whose network dances at once (--show default)."
        )
    if show is not None:
        refuse_idle(context, ("recordings", "feedback"), "with --show")
    if not region:
        refuse_idle(context, ("phrase",), "without --region")
    elif phrase is None and show is None:
        raise typer.BadParameter("With --region give the --phrase that the rest of the body dances.")
    walk, noise = ("spread", "speed", "samples"), ("offset", "seed")
    if feedback is not None:
        refuse_idle(context, (*walk, *noise, "hop", "other", "mix"), "with --feedback")
    elif one is not None:
        refuse_idle(context, walk, "with --from")
        if other is None:
            refuse_idle(context, ("mix",), "without --to")
        if not offset:
            refuse_idle(context, ("seed",), "with --from, except with --offset")
    else:
        refuse_idle(context, ("other", "mix", "offset"), "without --from")
        if samples:
            refuse_idle(context, ("speed",), "with --samples")
    with clear_errors("granular"):
        from appliance.studio.granular.walk import GranularOptions, run

        run(
            GranularOptions(
                checkpoint=checkpoint,
                show=show,
                out=out,
                recordings=recordings,
                seconds=seconds,
                seed=seed,
                spread=spread,
                speed=speed,
                hop=hop,
                samples=samples,
                one=one,
                other=other,
                mix=mix,
                offset=offset,
                feedback=feedback,
                phrase=phrase,
                regions=tuple(region or ()),
                reading=reading,
            )
        )
