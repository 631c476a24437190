"""`bunraku keep`: the keeper of this box, which carries the journal and the dance's place to the disk."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

from appliance.box.log_writer import LogWriter
from appliance.box.notify import Notifier
from appliance.box.runtime_folder import Claim, runtime_folder
from appliance.box.stop_signals import stop_signals
from appliance.keeper.keeper import END_BESIDE_S, END_S, KeeperHealth, mirrored_by, supervise
from appliance.keeper.mirror_process import MirrorProcess
from appliance.release.trial import MirroredProof
from appliance.show.box import load_box


def keep_box(
    box_file: Path | None,
    journal: Path | None = None,
    minutes: float | None = None,
    chosen: Path | None = None,
) -> int:
    """Keep until a signal comes; the exit status. journal, minutes: others than the box file's.

    chosen: what the preflight chose; that it dances is kept, too.

    Raises RuntimeFolderError where another keeper has this box already, ConfigError.
    """
    box = load_box(box_file)
    runtime = runtime_folder(box)
    with (
        stop_signals() as stopped,
        closing(LogWriter()) as speaker,
        closing(Claim(runtime, "keeper")),
        closing(Notifier()) as notifier,
    ):
        mirrored = mirrored_by(box, runtime, journal or box.journal.folder, minutes or box.journal.minutes)
        if chosen is not None:
            mirrored.append(MirroredProof(runtime, chosen))
        end_s = END_BESIDE_S if chosen is None else END_S
        processes = [MirrorProcess(one, runtime, end_s, speaker.say) for one in mirrored]
        health = KeeperHealth(runtime)
        notifier.ready("The journal and the place of the dance are kept.")

        def after_look(now: float) -> None:
            notifier.ping(now)
            health.report(processes, now)

        supervise(processes, stopped, after_look, end_s)
        notifier.stopping()
        health.end(time.monotonic())
    return 0
