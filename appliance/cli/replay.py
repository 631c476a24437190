"""`bunraku replay`: dance a journal again through the same tick, and say where it differs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from appliance.recorder.environment import differing_files, differing_software, environment
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import Run, read_journal
from appliance.show.bundle import bundled_shows, default_show_path, named_show
from appliance.show.show import load_show
from appliance.show_control.packet import readable
from appliance.stage.comparison import METRES_PER_DEGREE, Comparison
from appliance.stage.replay import Replay

# Other processors round differently, and iterations amplify that: an emulated Nehalem was 0.46 degrees and
# 1.9 mm off at worst in 25 s of the default show that a Xeon with AVX-512 had recorded (docs/journal.md).
TOLERANCE_DEGREES = 2.0
_PROGRESS_TICKS = 500


def replay(
    journal: Annotated[
        Path, typer.Argument(help="Folder of a journal, a segment in it, or an exported file.")
    ],
    show: Annotated[
        Path | None,
        typer.Option(callback=named_show, help="Show bundle. Default: the one that was danced then."),
    ] = None,
    from_s: Annotated[float, typer.Option("--from", min=0.0, help="Second of a run to begin at.")] = 0.0,
    tolerance: Annotated[
        float | None,
        typer.Option(min=0.0, help="Degrees that a joint may be off; 0: not a single bit may differ."),
    ] = None,
) -> int:
    """Dance a journal again, step by step as it was recorded, and report the first tick that differs."""
    outcomes = [
        _replay(run, show, from_s, tolerance, readable(f"Run {number} of '{run.header['show']}'"))
        for number, run in enumerate(read_journal(journal).runs, 1)
    ]
    if not any(ticks for ticks, _ in outcomes):
        raise JournalError(f"{journal}: nothing of it can be danced again. Choose an earlier second.")
    return 0 if all(is_same for _, is_same in outcomes) else 1


def _replay(
    run: Run, given: Path | None, from_s: float, tolerance: float | None, name: str
) -> tuple[int, bool]:
    """How many ticks were danced again, and whether all came out the same."""
    if not run.keyframes:
        print(f"{name}: {len(run.ticks)} ticks, and no keyframe was kept: it can be drawn, not danced again.")
        return 0, True
    lasted_s = float(run.ticks["frame_time"][-1] - run.ticks["frame_time"][0])
    if from_s > lasted_s:
        print(f"{name}: it lasts {lasted_s:.1f} s, and is left out.")
        return 0, True
    directory = _show_of(run, given)
    others = differing_software(run.header, environment())
    files = [f"the show's {file}" for file in differing_files(run.header["show_files"], directory)]
    if tolerance is None:  # bit for bit on the machine that recorded it
        tolerance = TOLERANCE_DEGREES if others or files else 0.0
    comparison = Comparison(float(run.ticks["frame_time"][0]), tolerance)
    again = Replay(run, load_show(directory))
    for danced in again.dance(comparison, from_s):
        if danced % _PROGRESS_TICKS == 0:
            _progress(name, danced, len(run.ticks))
    _progress("", 0, 0)
    for line in _reported(name, comparison, again, [*others, *files], tolerance):
        print(readable(line))
    return comparison.ticks, comparison.first is None


def _reported(
    name: str, comparison: Comparison, again: Replay, others: list[str], tolerance: float
) -> list[str]:
    ticks, first, worst = comparison.ticks, comparison.first, comparison.worst
    if tolerance:
        bound = f"within {tolerance:g} degrees and {1000 * METRES_PER_DEGREE * tolerance:g} mm"
    else:
        bound = "bit for bit"
    lines = [f"{name}: {ticks} ticks danced again ({ticks / 50:.1f} s)."]
    if others:
        lines.append(f"Other than in the recording: {'; '.join(others)}.")
    if again.skipped:
        lines.append(f"{again.skipped} ticks were not: before the first keyframe, or around a gap.")
    if again.forced:
        lines.append(
            f"{again.forced} ticks had a network that failed then, and not here: taken as they were."
        )
    if first is None:
        lines.append(f"All are the same, {bound}.")
    else:
        lines.append(f"The first that differs ({bound}): {first.sentence()}")
    if worst is not None:
        lines.append(f"The farthest off: {worst.sentence()}")
    return lines


def _show_of(run: Run, given: Path | None) -> Path:
    """The bundle that was danced: as given, where it was, or one that comes with the box."""
    recorded = run.header["show_directory"]
    if given is not None:
        return given
    if recorded is not None and Path(recorded).is_dir():
        return Path(recorded)
    files = run.header["show_files"]
    bundled = [show for show in bundled_shows().values() if not differing_files(files, show)]
    if bundled or recorded is None:
        return next(iter(bundled), default_show_path())
    raise JournalError(
        f"The show '{run.header['show']}' is not where it was ({recorded}). Name its bundle: --show DIR."
    )


def _progress(name: str, danced: int, ticks: int) -> None:
    """A line on the terminal that replaces itself; an empty one at the end."""
    if sys.stderr.isatty():
        message = f"{name}: {danced} of {ticks} ticks" if name else ""
        print(f"\r{message:<78}\r" if not name else f"\r{message:<78}", end="", file=sys.stderr, flush=True)
