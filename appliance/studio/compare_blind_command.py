"""`bunraku compare-blind`: two dances, judged by people. The app joins the studio's commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.options.idle_options import refuse_idle
from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.clear_errors import clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
QUESTION = "Which of the two is danced better?"


@app.command(name="compare-blind")
@reading_options
def compare_blind(
    context: typer.Context,
    first: Annotated[
        Path | None, typer.Argument(metavar="A", help="BVH file or folder of one.", show_default=False)
    ] = None,
    other: Annotated[
        Path | None, typer.Argument(metavar="B", help="The same of the other.", show_default=False)
    ] = None,
    pairs: Annotated[int, typer.Option(min=1, max=200, help="How many pairs a voter sees.")] = 20,
    seconds: Annotated[float, typer.Option(min=1.0, max=30.0, help="Length of a clip.")] = 5.0,
    question: Annotated[str, typer.Option(help="Above the pairs.")] = QUESTION,
    seed: Annotated[int, typer.Option(help="The same seed gives the same clips and sides.")] = 1,
    out: Annotated[Path, typer.Option(help="The page, one HTML file.")] = Path("out/compare.html"),
    votes: Annotated[
        list[Path] | None, typer.Option(help="Votes that the page saved, counted instead; repeatable.")
    ] = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Make a page on which people choose between clips of two dances, and count their votes.

    The page needs no network. Neither names nor sides give a dance away; at its end the votes are downloaded.
    --votes gives the preference with its 95 % interval: one that includes 50 % proves nothing.
    """
    if votes:
        options = ("first", "other", "pairs", "seconds", "question", "seed", "out")
        refuse_idle(context, options, "with --votes, which counts")
    elif first is None or other is None:
        raise typer.BadParameter("Give A and B for a page, or --votes FILE to count.")
    with clear_errors("compare-blind"):
        if votes:
            from appliance.studio.blind_pairs.votes import result_of

            print("\n".join(result_of(votes).sentences()))
            return
        from appliance.studio.blind_pairs.study import StudyOptions, write_study

        assert first is not None and other is not None
        write_study(StudyOptions(first, other, out, pairs, seconds, seed, question, reading))
        typer.echo(
            f"{out}: {pairs} pairs. Open it in a browser, or send it; each voter sends a file back.", err=True
        )
