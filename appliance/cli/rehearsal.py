"""A rehearsal: the projection in a window where there is a display, and a picture of it at the end."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from appliance.box.child import BUNRAKU, finished
from appliance.show.look import looks_by_name
from appliance.show.show import Show

if TYPE_CHECKING:
    from appliance.cli.pictures import RecordedDance

PICTURED_S = 10.0
_RENDERED_WITHIN_S = 120.0  # a processor without a graphics card takes two seconds


def has_display(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether windows can be seen here: X11 or Wayland."""
    return bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))


def rehearsal_picture(journal: Path, out: Path, show: Show) -> list[str]:
    """Render the last ten seconds of a journal into `out`, in the show's first look; what to say about it.

    Where nothing can be rendered, a filmstrip is drawn instead, and the reason is given. Raises JournalError,
    StageError.
    """
    look = next(iter(looks_by_name(show.config.looks)))
    from appliance.cli.pictures import draw_dance, load_dance

    whole = load_dance(journal)
    start_s = pictured_from(whole)
    trouble = _render(journal, out, show.directory, look, start_s)
    dance = whole.part(start_s, PICTURED_S)
    marked = ", what a hand holds in colour" if dance.holds is not None and dance.holds.any() else ""
    if trouble is None:
        return [f"The dance just now, as the projector shows it{marked}: {out}"]
    return [
        f"The projection cannot be rendered here: {trouble}",
        f"The dance just now{marked}: {draw_dance(dance, out)}",
    ]


def pictured_from(dance: RecordedDance) -> float:
    """Second at which a picture of the end begins: ten seconds before it, and not before a hand leads."""
    danced = dance.recordings[0]
    firmest = np.zeros(len(danced)) if dance.holds is None else dance.holds.max(axis=(1, 2))
    led = np.flatnonzero(firmest > 0.5)
    first_s = led[0] / danced.fps if len(led) else 0.0
    return max(0.0, danced.seconds - PICTURED_S, float(first_s))


def _render(journal: Path, out: Path, show: Path, look: str, start_s: float) -> str | None:
    """The error, or None. Runs in its own process, which a broken graphics driver may crash."""
    command = [
        *(*BUNRAKU, "filmstrip", str(journal), "--out", str(out)),
        *("--start", str(start_s), "--seconds", str(PICTURED_S), "--look", look, "--show", str(show)),
    ]
    done = finished(command, _RENDERED_WITHIN_S)
    if done.returncode == 0:
        return None
    said = done.stderr.strip().splitlines()
    if done.returncode < 0 or not said:
        return (
            f"the graphics driver ended it (status {done.returncode}). On Debian software rendering "
            "needs libgl1-mesa-dri, libegl1, libgles2 and libgbm1."
        )
    return said[-1].removeprefix("bunraku: ")
