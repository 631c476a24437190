"""`bunraku export`: a checkpoint becomes a show."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.console import Console

from appliance.studio.data import sources
from appliance.studio.evaluation.coders import load_checkpoint
from appliance.studio.evaluation.puppetry_words import print_answer
from appliance.studio.export.release import Request, release
from appliance.studio.studio_error import StudioError
from appliance.studio.train_command import reading


def run(checkpoint: Path, out: Path, recordings: Path | None, phrase: Path | None, name: str | None) -> None:
    """Write the bundle and say what ships and why."""
    console = Console(stderr=True)
    if checkpoint.is_dir():
        checkpoint = checkpoint / "checkpoint.pt"
    if not checkpoint.exists():
        raise StudioError(f"{checkpoint} does not exist. Give the checkpoint.pt of a training.")
    source = sources.remembered(load_checkpoint(checkpoint)[1], recordings, checkpoint)
    dataset = source.load(reading(console))
    request = Request(checkpoint, source.recordings, out, name or out.resolve().name, phrase)
    report = release(request, dataset, source.catalogue, lambda words: console.print(words, highlight=False))
    print_answer(console, report["puppetry"])
    once = report["degrees"]["1"]["mean"]
    console.print(
        f"{out}: {once:.2f} degrees a joint after one iteration. Look at {out / 'report.png'}; "
        f"dance it: bunraku play --show {shlex.quote(str(out))} --emulate",
        highlight=False,
        soft_wrap=True,
    )
