"""`--chosen FILE`: show and box file as the preflight chose them, for every command that has a `--box`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.release.choice import box_of as box_of
from appliance.release.choice import require_no

ChosenFile = Annotated[
    Path | None,
    typer.Option(
        "--chosen", help="Show and box file as `bunraku preflight` chose them: /run/bunraku/chosen.json."
    ),
]


def pair_of(show: Path | None, box: Path | None, chosen: Path | None) -> tuple[Path | None, Path | None]:
    """The show and the box file that the stage means, whose start is counted. Raises ConfigError."""
    if chosen is None:
        return show, box
    require_no("--show", show, chosen)
    require_no("--box", box, chosen)
    import time

    from appliance.release.trial import pair_to_dance

    pair = pair_to_dance(chosen, time.monotonic(), lambda words: print(words, flush=True))
    return pair.show, pair.box
