"""Trying what was chosen: a show that dances is proven; one that does not is put aside for the next."""

from __future__ import annotations

import contextlib
import json
import logging
import os
from pathlib import Path
from typing import NamedTuple

from appliance.box.durable import alone_in, write_whole
from appliance.keeper.fallback import CHOICE_NOT_SAVED
from appliance.keeper.mirror import reason_of
from appliance.outputs.frame_reader import FrameReader
from appliance.pose.foreign_file import stored_json
from appliance.release.choice import CHOSEN, Aside, Choice, ShowAndBox

_log = logging.getLogger(__name__)

TRIES, ANEW = "tries", "anew"
PROVEN_S = 10.0  # a show that has danced for this long dances on this box
_STARTS, _STARTS_OF_A_GOOD_ONE = 3, 6


class Tries(NamedTuple):
    """Consecutive starts in which a pair did not dance long enough, and the process of the newest."""

    id: str = ""
    starts: int = 0
    pid: int = 0


def chosen_to_dance(chosen: Path, now: float) -> ShowAndBox:
    """The choice to dance in this start, which is counted; never raises, because something always dances.

    A new pair has to dance for PROVEN_S within three starts. A proven one may be killed any number of times,
    if a frame came each time.
    """
    choice = Choice.read(chosen)
    if choice is None:
        _log.error(
            f"{chosen} is missing or broken: what was chosen is not known. The audience sees the show that "
            "comes with the box. Look what the preflight says: systemctl status bunraku-preflight."
        )
        return ShowAndBox(good=True)
    folder = chosen.parent
    choice = _found_again(chosen, choice)
    tries = _read_tries(folder, choice.first, now)
    if tries is not None and len(choice.pairs) > 1:
        most = _STARTS_OF_A_GOOD_ONE if choice.first.good else _STARTS
        if tries.starts >= most:
            choice, tries = _put_aside(chosen, choice, most), Tries(choice.pairs[1].id)
    if tries is not None:
        with contextlib.suppress(OSError):
            newest = tries._replace(starts=tries.starts + 1, pid=os.getpid())
            write_whole(folder / TRIES, json.dumps(newest).encode())
    return choice.first


def ended_well(chosen: Path) -> None:
    """The stage was ended as it should: this start counts for nothing."""
    with contextlib.suppress(OSError):
        (chosen.parent / TRIES).unlink()


class MirroredProof:
    """After PROVEN_S of dancing: the pair that dances is good, and those that did not dance are let go."""

    name, fallback = "That a show has danced", CHOICE_NOT_SAVED
    recovered = "That the show has danced is kept now."

    def __init__(self, runtime: Path, chosen: Path) -> None:
        self._runtime, self._chosen = runtime, chosen
        self._frames: FrameReader | None = None  # opened by the process that copies
        self._proven: tuple[int, str] | None = None

    def copy(self, now: float) -> None:
        """As Mirrored; while a preflight reads a stick it waits for another turn."""
        if self._frames is None:
            self._frames = FrameReader(self._runtime)
        newest, facts = self._frames.newest(now), self._frames.facts
        if newest is None or facts is None or facts.rehearsal or newest.left - facts.started < PROVEN_S:
            return
        choice = Choice.read(self._chosen)
        if choice is None or facts.show_directory != choice.first.show.resolve():
            return
        proven = (facts.pid, choice.first.id)
        if self._proven != proven and self._is_noted(choice.first.id):
            self._proven = proven

    @property
    def folder(self) -> Path:
        """On the disk, as the choice names it."""
        choice = Choice.read(self._chosen)
        return choice.data if choice is not None else self._chosen.parent

    def explain(self, error: Exception) -> str:
        return (
            f"{self._chosen.parent} or the data partition: that the show has danced cannot be kept "
            f"({reason_of(error)}). The dance goes on; after the next power-on the show is tried again. "
            "Check the data partition."
        )

    def close(self) -> None:
        if self._frames is not None:
            self._frames.close()

    def _is_noted(self, identity: str) -> bool:
        try:
            with alone_in(self._chosen.parent):
                choice = Choice.read(self._chosen)
                if choice is None or choice.first.id != identity:
                    return False
                choice.with_good(identity).write(self._chosen)
            with alone_in(choice.data):
                saved = Choice.read(choice.data / CHOSEN)
                noted = None if saved is None else saved.with_good(identity).without(choice)
                if noted is not None and noted != saved:
                    noted.write(choice.data / CHOSEN)
        except BlockingIOError:
            return False
        return True


def _read_tries(folder: Path, pair: ShowAndBox, now: float) -> Tries | None:
    """The result of the starts before this one; None while another process still dances."""
    try:
        tries = Tries(*stored_json(folder / TRIES))
    except (OSError, ValueError, TypeError):
        return Tries(pair.id)
    if tries.pid != os.getpid() and Path(f"/proc/{tries.pid}").exists():
        return None
    if tries.id != pair.id:
        return Tries(pair.id)
    danced_s = _danced_s(folder, tries.pid, now)
    enough_s = 0.0 if pair.good else PROVEN_S
    return tries._replace(starts=0) if danced_s is not None and danced_s >= enough_s else tries


def _danced_s(folder: Path, pid: int, now: float) -> float | None:
    """How long this process danced; None if it sent no frame."""
    with contextlib.closing(FrameReader(folder)) as frames:
        newest = frames.newest(now)
        if newest is None or frames.facts is None or frames.facts.pid != pid:
            return None
        return newest.left - frames.facts.started


def _put_aside(chosen: Path, choice: Choice, starts: int) -> Choice:
    before, after = choice.pairs[:2]
    message = (
        f"The {before.source} did not dance in {starts} starts and is put aside. The audience sees the dance "
        f"that {_source(after)}. Run bunraku check on it, mend it, and bring it again."
    )
    left = choice._replace(pairs=choice.pairs[1:], aside=(*choice.aside, Aside(before.id, message)))
    return _publish(chosen, choice, left, message)


def _found_again(chosen: Path, choice: Choice) -> Choice:
    """Drops leading pairs whose disk is missing, instead of timing out on each."""
    there = next((number for number, one in enumerate(choice.pairs) if one.is_there), len(choice.pairs) - 1)
    if there == 0:
        return choice
    message = (
        f"The {choice.first.source} cannot be found any more. The audience sees the dance that "
        f"{_source(choice.pairs[there])}. Look at the data partition: bunraku doctor."
    )
    left = choice._replace(pairs=choice.pairs[there:], refused=(message, *choice.refused))
    return _publish(chosen, choice, left, message)


def _publish(chosen: Path, before: Choice, after: Choice, message: str) -> Choice:
    """Publishes the choice that dances from now on to all processes of the box."""
    _log.warning(message)
    with contextlib.suppress(OSError):
        after.write(chosen)
        if before.first.box != after.first.box:
            (chosen.parent / ANEW).touch()
    return after


def _source(pair: ShowAndBox) -> str:
    return pair.source if not pair.id else f"came before it ({pair.source})"
