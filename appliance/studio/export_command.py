"""`bunraku export`: a checkpoint becomes a show."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.console import Console

from appliance.pose.reading_options import ReadingOptions
from appliance.studio.data import sources
from appliance.studio.evaluation.coders import load_puppet
from appliance.studio.export.release import Request, release
from appliance.studio.trained_on import reading_progress


def run(
    checkpoint: Path,
    out: Path,
    recordings: Path | None,
    phrase: Path | None,
    name: str | None,
    hand: str | None,
    reading: ReadingOptions,
) -> None:
    """Write the bundle and print what ships and why. Raises StudioError, or OSError."""
    console = Console(stderr=True)
    if checkpoint.is_dir():
        checkpoint = checkpoint / "checkpoint.pt"
    source = sources.remembered(load_puppet(checkpoint)[1], recordings, checkpoint, reading)
    dataset = source.load(reading_progress(console))
    report = release(Request(checkpoint, source, out, name or "", phrase, hand), dataset, console)
    console.print(
        f"{out}: {report['degrees']['1']['mean']:.2f} degrees a joint after one iteration. "
        f"See {out / 'report.png'}; dance it: bunraku play --show {shlex.quote(str(out))} --emulate",
        highlight=False,
        soft_wrap=True,
    )
