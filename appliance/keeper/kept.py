"""What a box keeps on its disk, each thing carried by a process of its own, and what attends to these."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

from appliance.box.checkpoint_file import CheckpointCarrier
from appliance.box.runtime_folder import Claim, RuntimeFolderError
from appliance.keeper.carrier_process import CarrierProcess, Kept
from appliance.keeper.journal_carrier import JournalCarrier
from appliance.keeper.keeper import LOOK_S
from appliance.keeper.sensor_memory_carrier import MemoryCarrier
from appliance.show.box import BoxConfig

# For the last turns, once the show has ended; systemd gives the keeper 10 s, `bunraku play` gives it 3 s.
LAST_TURN_S = 1.5
_REST_S = 3.5  # and LAST_TURN_S: a person waits at a terminal


def kept_by(box: BoxConfig, runtime: Path, journal: Path | None, minutes: float) -> list[Kept]:
    """What this box keeps: its journal, where one is wanted; its place and what it learns of its sensors, in
    the state folder, where there is one.
    """
    kept: list[Kept] = []
    if (state := box.state_folder) is not None:
        place, memory = partial(CheckpointCarrier, runtime, state), partial(MemoryCarrier, runtime, state)
        kept.append(Kept("The place of the dance", CheckpointCarrier.fallback, place))
        kept.append(Kept("What sensors taught the box", MemoryCarrier.fallback, memory))
    if journal is not None:
        carrier = partial(JournalCarrier, runtime, journal, minutes)
        kept.append(Kept("The journal", JournalCarrier.fallback, carrier))
    return kept


def keep_all(
    processes: Sequence[CarrierProcess],
    stopped: Callable[[], bool],
    after_look: Callable[[float], None],
    end_s: float,
) -> None:
    """Attend to them until `stopped` and all have ended, for end_s and LAST_TURN_S at most.

    after_look: for the watchdog, and to tell how they are; monotonic seconds.
    """
    until = float("inf")
    while True:
        now = time.monotonic()
        for one in processes:
            one.look(now)
        after_look(now)
        if until == float("inf") and stopped():
            until = now + end_s + LAST_TURN_S
            for one in processes:
                one.ask_to_end()
        if now >= until or (until < float("inf") and all(one.has_ended for one in processes)):
            break
        time.sleep(LOOK_S)
    for one in processes:
        one.leave()


def keep_rest(
    box: BoxConfig, runtime: Path, journal: Path | None, minutes: float, say: Callable[[str], None]
) -> None:
    """After the dance: what a keeper did not live to carry, for it was ended while it started."""
    try:
        claim = Claim(runtime, "keeper")
    except RuntimeFolderError:  # one that is still at work
        return
    with closing(claim):
        processes = [
            CarrierProcess(one, runtime, 0.0, say) for one in kept_by(box, runtime, journal, minutes)
        ]
        keep_all(processes, lambda: True, lambda now: None, _REST_S)
