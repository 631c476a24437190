"""`bunraku improvise`: a phrase that a trained dancer made up. Its app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.studio.clear_errors import INTERRUPTED, clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
def improvise(
    checkpoint: Annotated[Path, typer.Argument(help="checkpoint.pt of a training: the pose autoencoder.")],
    out: Annotated[Path, typer.Option(help="The phrase, a BVH file; its report and picture lie beside it.")],
    recordings: Annotated[
        Path | None, typer.Option(help="Folder with the dancer's BVH recordings, if they have moved.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=2.0, max=600.0, help="About how long the phrase is.")] = 90.0,
    seed: Annotated[int, typer.Option(help="Another seed, another dance.")] = 1,
    minutes: Annotated[float, typer.Option(min=0.01, help="How long to train the improviser.")] = 12.0,
    steps: Annotated[int, typer.Option(min=0, help="How many steps to train, instead of minutes.")] = 0,
    temperature: Annotated[
        float, typer.Option(min=0.05, max=2.0, help="1: as free as learned; less: closer to its habits.")
    ] = 1.2,
    dances: Annotated[int, typer.Option(min=1, help="How many dances to choose the phrase from.")] = 16,
    dance_minutes: Annotated[float, typer.Option(min=0.05, help="How long each of them is.")] = 4.0,
    threads: Annotated[int, typer.Option(min=0, help="Processor cores to use; 0: all.")] = 0,
) -> None:
    """Train an improviser on a dancer's recordings and let it make an endless phrase.

    The improviser is kept beside the phrase; the same command again goes on where it stood, and once it is
    trained only dances (another --seed gives another phrase).
    """
    with clear_errors("improvise"):
        from appliance.studio.improviser.improvisation import Wish, run
        from appliance.studio.improviser.phrase import PhraseWish

        wish = Wish(
            checkpoint=checkpoint,
            out=out,
            recordings=recordings,
            minutes=minutes,
            steps=steps,
            threads=threads,
            phrase=PhraseWish(seconds, seed, temperature, dances, dance_minutes),
        )
        done = run(wish)
    if not done:
        raise typer.Exit(INTERRUPTED)
