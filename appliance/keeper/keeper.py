"""The keeper: carries what must survive a power cut from memory to the disk, each thing in its own process.

The stage touches no disk while it dances: a disk that is full, read-only, missing or hanging stops only these
mirrors.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from pathlib import Path

from appliance.box.fallback import Fallbacks
from appliance.box.mounts import disk_of, memory_of
from appliance.box.process_health import ProcessHealthWriter
from appliance.box.runtime_folder import Claim, RuntimeFolderError
from appliance.keeper.fallback import OF_THE_KEEPER, SAVED_IN_MEMORY
from appliance.keeper.journal import MirroredJournal
from appliance.keeper.mirror import LOOK_S, Mirror, Mirrored
from appliance.keeper.mirror_process import MirrorProcess
from appliance.keeper.records import mirrored_checkpoint, mirrored_gestures, mirrored_sensor_memory
from appliance.show.box import BoxConfig

# The machine goes down: services that start after the stage end before it (the lights may take 4 s), then the
# stage says that its show has ended (it may take 3 s). Beside a stage of one's own it says so at once.
END_S, END_BESIDE_S = 8.0, 1.0
# For the last turns, once the show has ended; systemd gives the keeper 10 s, `bunraku play` gives it 3 s.
LAST_TURN_S = 1.5
_REST_S = 3.5  # and LAST_TURN_S: a person waits at a terminal


class KeeperHealth:
    """The keeper's report to the box's other processes."""

    def __init__(self, runtime: Path, lasting: Path | None = None) -> None:
        """lasting: the folder that must outlive power-off; None: nobody counts on one."""
        self._fallbacks, self._named = Fallbacks(OF_THE_KEEPER), set[str]()
        self._health = ProcessHealthWriter(runtime, "keeper", self._fallbacks)
        if lasting is not None and (memory := memory_of(lasting)):
            self._fallbacks.concern(SAVED_IN_MEMORY.name, [memory])
            self._fallbacks.set(SAVED_IN_MEMORY.name, True)

    def report(self, mirrors: Iterable[Mirror | MirrorProcess], now: float) -> None:
        """Call it often; monotonic seconds."""
        for mirror in mirrors:
            if mirror.complaint and mirror.fallback.name not in self._named:
                self._named.add(mirror.fallback.name)
                self._fallbacks.concern(mirror.fallback.name, filter(None, [disk_of(mirror.folder)]))
            self._fallbacks.set(mirror.fallback.name, mirror.complaint)
        self._health.publish_health(now)

    def end(self, now: float) -> None:
        """The keeper ends as it should."""
        self._health.end(now)
        self._health.close()


def mirrored_by(box: BoxConfig, runtime: Path, journal: Path | None, minutes: float) -> list[Mirrored]:
    """The mirrors of this box: its journal, if one is wanted, and its records, if it has a state folder."""
    mirrored: list[Mirrored] = []
    if (state := box.state_folder) is not None:
        mirrored += [
            mirrored_checkpoint(runtime, state),
            mirrored_sensor_memory(runtime, state),
            mirrored_gestures(runtime, state),
        ]
    if journal is not None:
        mirrored.append(MirroredJournal(runtime, journal, minutes))
    return mirrored


def supervise(
    processes: Sequence[MirrorProcess],
    stopped: Callable[[], bool],
    after_look: Callable[[float], None],
    end_s: float,
) -> None:
    """Run them until `stopped` and all have ended, for end_s and LAST_TURN_S at most.

    after_look: for the watchdog, and to report health; monotonic seconds.
    """
    until = float("inf")
    while True:
        now = time.monotonic()
        for process in processes:
            process.supervise(now)
        after_look(now)
        if until == float("inf") and stopped():
            until = now + end_s + LAST_TURN_S
            for process in processes:
                process.request_end()
        if now >= until or (until < float("inf") and all(process.has_ended for process in processes)):
            break
        time.sleep(LOOK_S)
    for process in processes:
        process.abandon()


def keep_rest(box: BoxConfig, runtime: Path, journal: Path | None, minutes: float) -> None:
    """After the dance: carry what a keeper did not live to carry, because it was ended while it started."""
    try:
        claim = Claim(runtime, "keeper")
    except RuntimeFolderError:  # one that is still at work
        return
    with closing(claim):
        mirrored = mirrored_by(box, runtime, journal, minutes)
        processes = [MirrorProcess(one, runtime, 0.0) for one in mirrored]
        supervise(processes, lambda: True, lambda now: None, _REST_S)
