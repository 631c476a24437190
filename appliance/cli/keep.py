"""`bunraku keep`: the keeper of this box, which carries the journal and the dance's place to the disk."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from appliance.box.log_writer import LogWriter
from appliance.box.notify import Notifier
from appliance.box.runtime_folder import Claim, runtime_folder
from appliance.box.stop_signals import stop_signals
from appliance.cli.options import BoxFile, ChosenFile
from appliance.keeper.carrier_process import CarrierProcess, Kept
from appliance.keeper.keeper import END_BESIDE_S, END_S
from appliance.keeper.keeper_health import KeeperHealth
from appliance.keeper.kept import keep_all, kept_by
from appliance.release.choice import box_of
from appliance.release.promote_show import Proof
from appliance.show.box import load_box


def keep(
    box: BoxFile = None,
    journal: Annotated[Path | None, typer.Option(help="Another folder than the box file's.")] = None,
    minutes: Annotated[float | None, typer.Option(min=0.1, help="How much of it is kept.")] = None,
    chosen: ChosenFile = None,
) -> None:
    """Carry the journal and the place of the dance from memory to the disk, which may be slow or broken."""
    config = load_box(box_of(box, chosen))
    runtime = runtime_folder(config)
    with (
        stop_signals() as stopped,
        closing(LogWriter()) as speaker,
        closing(Claim(runtime, "keeper")),
        closing(Notifier()) as notifier,
    ):
        kept = kept_by(config, runtime, journal or config.journal.folder, minutes or config.journal.minutes)
        if chosen is not None:  # that this show has danced is kept, too
            kept.append(Kept("That a show has danced", Proof.fallback, lambda say: Proof(runtime, chosen)))
        end_s = END_BESIDE_S if chosen is None else END_S
        processes = [CarrierProcess(one, runtime, end_s, speaker.say) for one in kept]
        health = KeeperHealth(runtime)
        notifier.ready("The journal and the place of the dance are kept.")

        def after_look(now: float) -> None:
            notifier.ping(now)
            health.tell(processes, now)

        keep_all(processes, stopped, after_look, end_s)
        notifier.stopping()
        health.end(time.monotonic())
