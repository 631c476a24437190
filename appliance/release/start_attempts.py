"""Trying what was chosen: a show that does not dance is put aside, and the next one is tried."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from appliance.box.durable import write_whole
from appliance.outputs.frame_reader import FrameReader
from appliance.pose.foreign_file import kept_json
from appliance.release.choice import Aside, Choice, Pair

TRIES, ANEW = "tries", "anew"
PROVEN_S = 10.0  # a show that has danced for so long dances on this box
_STARTS, _STARTS_OF_A_GOOD_ONE = 3, 6


class Tries(NamedTuple):
    """Starts in a row in which a pair did not dance long enough, and the process of the newest."""

    id: str = ""
    starts: int = 0
    pid: int = 0


def pair_to_dance(chosen: Path, now: float, say: Callable[[str], None]) -> Pair:
    """What to dance in this start, which is counted; never raises, for something always dances.

    A pair that is new has to dance for PROVEN_S within three starts. One that has done so may be killed
    as often as somebody likes, if only each time a frame came.
    """
    choice = Choice.read(chosen)
    if choice is None:
        say(
            f"{chosen} is missing or broken: what was chosen is not known. The audience sees the show that "
            "comes with the box. Look what the preflight says: systemctl status bunraku-preflight."
        )
        return Pair(good=True)
    folder = chosen.parent
    choice = _found_again(chosen, choice, say)
    tries = _counted(folder, choice.first, now)
    if tries is not None and len(choice.pairs) > 1:
        most = _STARTS_OF_A_GOOD_ONE if choice.first.good else _STARTS
        if tries.starts >= most:
            choice, tries = _put_aside(chosen, choice, most, say), Tries(choice.pairs[1].id)
    if tries is not None:
        with contextlib.suppress(OSError):
            newest = tries._replace(starts=tries.starts + 1, pid=os.getpid())
            write_whole(folder / TRIES, json.dumps(newest).encode())
    return choice.first


def ended_well(chosen: Path) -> None:
    """The stage was ended as it should: this start counts for nothing."""
    with contextlib.suppress(OSError):
        (chosen.parent / TRIES).unlink()


def _counted(folder: Path, pair: Pair, now: float) -> Tries | None:
    """What became of the starts before this one; None while another process still dances."""
    try:
        tries = Tries(*kept_json(folder / TRIES))
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
    """How long this process danced; None when no frame of its own left it."""
    with contextlib.closing(FrameReader(folder)) as frames:
        newest = frames.newest(now)
        if newest is None or frames.facts is None or frames.facts.pid != pid:
            return None
        return newest.left - frames.facts.started


def _put_aside(chosen: Path, choice: Choice, starts: int, say: Callable[[str], None]) -> Choice:
    before, after = choice.pairs[:2]
    words = (
        f"The {before.source} did not dance in {starts} starts and is put aside. The audience sees the dance "
        f"that {_source(after)}. Run bunraku check on it, mend it, and bring it again."
    )
    left = choice._replace(pairs=choice.pairs[1:], aside=(*choice.aside, Aside(before.id, words)))
    return _told(chosen, choice, left, words, say)


def _found_again(chosen: Path, choice: Choice, say: Callable[[str], None]) -> Choice:
    """Without pairs at the front that are gone with their disk: to try them would cost the audience time."""
    there = next((number for number, one in enumerate(choice.pairs) if one.is_there), len(choice.pairs) - 1)
    if there == 0:
        return choice
    words = (
        f"The {choice.first.source} cannot be found any more. The audience sees the dance that "
        f"{_source(choice.pairs[there])}. Look at the data partition: bunraku doctor."
    )
    left = choice._replace(pairs=choice.pairs[there:], refused=(words, *choice.refused))
    return _told(chosen, choice, left, words, say)


def _told(chosen: Path, before: Choice, after: Choice, words: str, say: Callable[[str], None]) -> Choice:
    """What dances from now on, to all processes of the box."""
    say(words)
    with contextlib.suppress(OSError):
        after.write(chosen)
        if before.first.box != after.first.box:
            (chosen.parent / ANEW).touch()
    return after


def _source(pair: Pair) -> str:
    return pair.source if not pair.id else f"came before it ({pair.source})"
