"""`bunraku path`, `map` and `explore`: the space of a dancer's poses. The app joins the studio's commands."""

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

Model = Annotated[Path | None, typer.Option(help="checkpoint.pt of bunraku train --model pose.")]
Moved = Annotated[
    Path | None, typer.Option(help="Folder with the dancer's BVH recordings, if they have moved.")
]


@app.command()
@reading_options
def path(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="The dance, a BVH file; its figures and picture lie beside it.")],
    phrase: Annotated[
        Path | None,
        typer.Argument(help="BVH of the phrase that wobbles.", show_default="the phrase of --show"),
    ] = None,
    model: Model = None,
    show: OfShow = None,
    wobble: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="AMPLITUDE FREQUENCY",
            help="Sinusoids on the phrase's path: standard deviations (0.3 is a lot), Hz.",
        ),
    ] = None,
    draw: Annotated[
        Path | None, typer.Option(help="A line over the map becomes the dance: map.svg drawn on, or a CSV.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Phases of the wobble.")] = 1,
    start: Annotated[float, typer.Option(min=0.0, help="Second of the phrase to begin at.")] = 0.0,
    seconds: Annotated[float, typer.Option(min=0.5, max=600.0, help="How long the dance is.")] = 10.0,
    region: OfRegion = None,
    recordings: Moved = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Make a dance of a path through the space of a dancer's poses ('Beyond Imitation').

    A phrase's own path with a wobble, or a line that you draw over the map that bunraku map writes. With
    --region only a part of the body follows it, and the rest dances the phrase.
    """
    require_either(context, model, show)
    needs_phrase = wobble is not None or bool(region)
    has_phrase = phrase is not None or (show is not None and needs_phrase)
    if (wobble is None) == (draw is None) or has_phrase != needs_phrase:
        raise typer.BadParameter(
            "Give a PHRASE with --wobble AMPLITUDE FREQUENCY, or --draw FILE; --draw with --region takes a "
            "PHRASE too."
        )
    if wobble is not None and not (0 <= wobble[0] <= 5 and 0 < wobble[1] <= 10):
        raise typer.BadParameter("--wobble takes an amplitude of 0 to 5 and a frequency up to 10 Hz.")
    if draw is not None:
        refuse_idle(context, ("seed",) if region else ("seed", "start"), "with --draw")
    with clear_errors("path"):
        from appliance.studio.pose_space.path import PathOptions, run

        run(
            PathOptions(
                model=model,
                out=out,
                show=show,
                phrase=phrase,
                recordings=recordings,
                wobble=wobble,
                draw=draw,
                seed=seed,
                start=start,
                seconds=seconds,
                regions=tuple(region or ()),
                reading=reading,
            )
        )


@app.command(name="map")
@reading_options
def map_(
    context: typer.Context,
    files: Annotated[
        list[Path],
        typer.Argument(
            default_factory=list,
            help="BVH recordings to lay over the map.",
            show_default="the phrase of --show",
        ),
    ],
    model: Model = None,
    show: OfShow = None,
    out: Annotated[
        Path, typer.Option(help="Folder for the page, the pictures and the sheet to draw on.")
    ] = Path("out/map"),
    seconds: Annotated[float, typer.Option(min=1.0, help="How much of each recording.")] = 60.0,
    recordings: Moved = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Draw the space of a dancer's poses as a map, with recordings as paths over it.

    PCA, the pose autoencoder and, where umap-learn is installed, UMAP side by side; a page to turn in a
    browser, without a network; with two recordings of the same phrase their distance over time.
    """
    require_either(context, model, show)
    if not files and show is None:
        raise typer.BadParameter("Give the recordings to lay over the map, or --show for its phrase.")
    with clear_errors("map"):
        from appliance.studio.pose_space.pose_map import MapOptions, run

        run(MapOptions(model, out, tuple(files), show, recordings, seconds, reading))


@app.command()
@reading_options
def explore(
    context: typer.Context,
    out: Annotated[
        Path, typer.Option(help="The dance, a BVH file; figures, pictures and map lie beside it.")
    ],
    files: Annotated[
        list[Path],
        typer.Argument(
            default_factory=list,
            help="BVH recordings of rehearsals or performances that count as visited, too.",
            show_default="none",
        ),
    ],
    model: Model = None,
    show: OfShow = None,
    phrase: Annotated[
        Path | None,
        typer.Option(help="BVH whose movement is danced there.", show_default="the phrase of --show"),
    ] = None,
    count: Annotated[int, typer.Option(min=1, max=12, help="How many regions.")] = 5,
    seconds: Annotated[float, typer.Option(min=6.0, max=600.0, help="How long the dance is.")] = 30.0,
    start: Annotated[float, typer.Option(min=0.0, help="Second of the phrase to begin at.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Another seed looks elsewhere.")] = 1,
    recordings: Moved = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Find where a dancer could go and never went, and dance there.

    Known poses are mixed, in the latents and limb by limb. Regions that no recording comes near to, although
    each limb was so before, are listed, the largest first. The dance begins and ends as the phrase, and
    carries the phrase's movement through them.
    """
    require_either(context, model, show)
    if phrase is None and show is None:
        raise typer.BadParameter(
            "Give the --phrase whose movement is danced there, or --show for its phrase."
        )
    with clear_errors("explore"):
        from appliance.studio.pose_space.explore import ExploreOptions, run

        run(
            ExploreOptions(
                model=model,
                out=out,
                seen=tuple(files),
                show=show,
                phrase=phrase,
                recordings=recordings,
                count=count,
                seconds=seconds,
                start=start,
                seed=seed,
                reading=reading,
            )
        )
