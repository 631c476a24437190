"""`bunraku keep`: the keeper of this box, which carries the journal and the dance's place to the disk."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from appliance.box.log import process_log
from appliance.box.notify import Notifier
from appliance.box.runtime_folder import Claim, runtime_folder
from appliance.box.stop_signals import stop_signals
from appliance.cli.options import BoxFile, ChosenFile
from appliance.keeper.keeper import END_BESIDE_S, END_S, KeeperHealth, mirrored_by, supervise
from appliance.keeper.mirror_process import MirrorProcess
from appliance.release.choice import box_of
from appliance.release.trial import MirroredProof
from appliance.show.box import load_box


def keep(
    box: BoxFile = None,
    journal: Annotated[
        Path | None, typer.Option(help="Folder for the journal, instead of the box file's.")
    ] = None,
    minutes: Annotated[float | None, typer.Option(min=0.1, help="How many minutes of it to keep.")] = None,
    chosen: ChosenFile = None,
) -> None:
    """Write the journal and the place of the dance to disk, so that a slow disk never holds up the dance."""
    config = load_box(box_of(box, chosen))
    runtime = runtime_folder(config)
    with (
        stop_signals() as stopped,
        process_log(),
        closing(Claim(runtime, "keeper")),
        closing(Notifier()) as notifier,
    ):
        mirrored = mirrored_by(
            config, runtime, journal or config.journal.folder, minutes or config.journal.minutes
        )
        if chosen is not None:
            mirrored.append(MirroredProof(runtime, chosen))
        end_s = END_BESIDE_S if chosen is None else END_S
        processes = [MirrorProcess(one, runtime, end_s) for one in mirrored]
        health = KeeperHealth(runtime, config.state_folder if chosen is not None else None)
        notifier.ready("The journal and the place of the dance are kept.")

        def after_look(now: float) -> None:
            notifier.ping(now)
            health.report(processes, now)

        supervise(processes, stopped, after_look, end_s)
        notifier.stopping()
        health.end(time.monotonic())
