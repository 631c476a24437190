"""A mirror keeps the disk's copy of one thing up to date, turn by turn, and survives what the disk does."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from appliance.box.fallback import Fallback
from appliance.recorder.journal_error import JournalError

_log = logging.getLogger(__name__)

TURN_S = 0.5  # so a power cut loses less than a second
LOOK_S = 0.05  # how often a process looks whether it is to end
RETRY_S = 10.0  # after a disk refused


class Mirrored(Protocol):
    """Copied to disk: the journal, the checkpoint, the sensors' memory, that a show has danced.

    name: what people call it; fallback: in force while the disk does not take it; recovered: the sentence
    when it does again; folder: on the disk. Nothing may be open before the first `copy`: the process that
    copies is forked.
    """

    name: str
    fallback: Fallback
    recovered: str

    @property
    def folder(self) -> Path: ...

    def copy(self, now: float) -> None:
        """Bring the disk up to date, monotonic seconds. Waits for the disk.

        Raises OSError, ValueError or JournalError.
        """

    def explain(self, error: Exception) -> str:
        """Data that cannot be saved and why, the effect for the audience, and what to do."""

    def close(self) -> None:
        """After the last copy."""


class Mirror:
    """Copies one thing again and again; an error is said once and tried again after RETRY_S.

    complaint: why the disk does not take it now, a sentence, else ""; failed: how often it did not.
    """

    def __init__(self, mirrored: Mirrored) -> None:
        self._mirrored = mirrored
        self._due = 0.0
        self.fallback, self.complaint, self.failed = mirrored.fallback, "", 0

    @property
    def folder(self) -> Path:
        """Where on the disk it goes."""
        return self._mirrored.folder

    def turn(self, now: float) -> None:
        """Copy if it is time; monotonic seconds. Waits as long as the disk does. Never raises."""
        if now >= self._due:
            self._copy(now)

    def last_turn(self, now: float) -> None:
        """Before the process ends: copy what is newest."""
        self._copy(now)
        self._mirrored.close()

    def _copy(self, now: float) -> None:
        try:
            self._mirrored.copy(now)
        except (OSError, ValueError, JournalError) as error:
            self.failed += 1
            self._due = now + RETRY_S
            complaint = self._mirrored.explain(error)
            if complaint != self.complaint:
                _log.warning(complaint)
            self.complaint = complaint
            return
        if self.complaint:
            self.complaint = ""
            _log.info(self._mirrored.recovered)


def mirror_until(
    stopped: Callable[[], bool],
    mirror: Mirror,
    goes_on: Callable[[], bool],
    end_s: float,
    after_turn: Callable[[], None] = lambda: None,
    monotonic: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Turn by turn until `stopped`, then one last turn.

    A show that still `goes_on` then is followed until its end, for `end_s` at most: an end that is not on the
    disk would be taken for a power cut.
    """
    asked_at: float | None = None

    def is_over() -> bool:
        nonlocal asked_at
        if asked_at is None and stopped():
            asked_at = monotonic()
        return asked_at is not None and (not goes_on() or monotonic() - asked_at >= end_s)

    while not is_over():
        until = monotonic() + TURN_S
        mirror.turn(monotonic())
        after_turn()
        while not is_over() and (rest_s := until - monotonic()) > 0.0:
            sleep(min(rest_s, LOOK_S))
    mirror.last_turn(monotonic())


def reason_of(error: Exception) -> str:
    """For people: what the disk says, or why the data does not fit."""
    return (isinstance(error, OSError) and error.strerror) or str(error)
