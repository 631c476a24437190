"""`bunraku improvise`: a phrase that a network invents. Its app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.idle_options import refuse_idle
from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.clear_errors import INTERRUPTED, clear_errors
from appliance.studio.model_or_show import OfRegion, OfShow

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
@reading_options
def improvise(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="The phrase, a BVH file; report and picture go beside it.")],
    checkpoint: Annotated[
        Path | None,
        typer.Argument(help="checkpoint.pt of a dancer; left out with --model.", show_default=False),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="checkpoint.pt of bunraku train --model improviser, instead of training one."),
    ] = None,
    show: OfShow = None,
    recordings: Annotated[
        Path | None, typer.Option(help="Folder with the dancer's BVH recordings, if they have moved.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=2.0, max=600.0, help="Approximate length.")] = 90.0,
    seed: Annotated[int, typer.Option(help="Another seed gives another dance.")] = 1,
    minutes: Annotated[float, typer.Option(min=0.01, help="Training time of the improviser.")] = 12.0,
    steps: Annotated[int, typer.Option(min=0, help="Training steps, instead of --minutes.")] = 0,
    temperature: Annotated[
        float, typer.Option(min=0.05, max=2.0, help="1: as free as the training; less: closer to habits.")
    ] = 1.2,
    prompt: Annotated[
        Path | None, typer.Option(help="BVH to continue, for --seconds, instead of an endless phrase.")
    ] = None,
    prompt_end: Annotated[
        float | None, typer.Option("--from", min=1.0, help="Second of the prompt to continue from.")
    ] = None,
    region: OfRegion = None,
    dances: Annotated[int, typer.Option(min=1, help="How many dances to choose the phrase from.")] = 16,
    dance_minutes: Annotated[float, typer.Option(min=0.05, help="Length of each dance.")] = 4.0,
    threads: Annotated[int, typer.Option(min=0, help="CPU cores to use. 0: all.")] = 0,
    *,
    reading: ReadingOptions,
) -> None:
    """Train an improviser on a dancer's recordings and let it make an endless phrase.

    The improviser is stored beside the phrase. If its training was stopped, the same command continues it.
    A trained one dances at once, and another --seed gives another phrase. With --prompt it continues a
    recording. With --show the show's improviser continues --prompt, or a moment of the show's phrase.
    The published network (--model, lstm-mixtures) makes no endless phrase: it continues the
    prompt, or a recorded moment that --seed chooses. With --region a part of the body improvises from --from
    on, and the rest goes on with the prompt.
    """
    if show is not None:
        others = (
            "checkpoint",
            "model",
            "recordings",
            "minutes",
            "steps",
            "dances",
            "dance_minutes",
            "threads",
        )
        refuse_idle(context, others, "with --show, whose improviser is trained and continues a phrase")
    if model is not None:
        refuse_idle(context, ("minutes", "steps"), "with --model, which is trained already")
    elif steps:
        refuse_idle(context, ("minutes",), "with --steps")
    if region and (prompt is None and show is None):
        raise typer.BadParameter("With --region give the --prompt, which the rest of the body goes on with.")
    if prompt is None and not region:
        refuse_idle(context, ("prompt_end",), "without --prompt")
    elif prompt is not None:
        refuse_idle(context, ("dances", "dance_minutes"), "with --prompt")
    with clear_errors("improvise"):
        from appliance.studio.improviser.improvise_options import ImproviseOptions, PhraseOptions

        options = ImproviseOptions(
            checkpoint=checkpoint,
            out=out,
            recordings=recordings,
            model=model,
            minutes=minutes,
            steps=steps,
            threads=threads,
            phrase=PhraseOptions(seconds, seed, temperature, dances, dance_minutes),
            prompt=prompt,
            prompt_end=prompt_end,
            regions=tuple(region or ()),
            reading=reading,
            show=show,
        )
        if show is not None:
            from appliance.studio.improviser.continuing import continue_of_show

            continue_of_show(options)
            return
        from appliance.studio.improviser import improvisation

        done = improvisation.run(options)
    if not done:
        raise typer.Exit(INTERRUPTED)
