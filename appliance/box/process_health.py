"""Process health: a small block of each process in the runtime folder, read by show control."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from appliance.box.block import BlockWriter
from appliance.box.fallback import Fallback, Fallbacks, Fallen, fallen
from appliance.box.record import Record
from appliance.box.runtime_folder import renew_lost
from appliance.pose.foreign_file import plain_json, stored_json

PROCESSES = ("control", "lights", "projector", "keeper", "console", "generator", "sound", "remote")
BEAT_S, LATE_S = 1.0, 5.0
_LARGEST, _SHORT = 8192, 40  # bytes; characters
_CHOSEN = "chosen.json"

DIED = {
    "control": Fallback(
        "control-died",
        "Show control died or hung. The dance went on; commands waited until it was started again, two "
        "seconds at most. If it goes on, look at its messages: journalctl -u bunraku-control.",
    ),
    "lights": Fallback(
        "lights-died",
        "The lights' process died or hangs. The nodes hold or fade as they are set, and it is started again "
        "within two seconds. If it goes on, look at its messages: journalctl -u bunraku-lights.",
    ),
    "projector": Fallback(
        "projector-died",
        "The projector's process died or hangs. The wall is black or stands still, and the picture is "
        "back within two seconds, after a hang within ten. If it goes on, look at its messages: "
        "journalctl -u bunraku-projector.",
    ),
    "keeper": Fallback(
        "keeper-died",
        "The keeper died or hangs. The audience sees nothing of it; journal and place are kept again when it "
        "is back. If it goes on, look at the disk: bunraku doctor.",
    ),
    "generator": Fallback(
        "generator-died",
        "The generator died or hangs. The last phrase plays on, and it is started again within seconds. "
        "If it goes on, look at its messages: journalctl -u bunraku-generator.",
    ),
    "console": Fallback(
        "console-died",
        "The page's process died or hangs. The audience sees nothing of it, and browsers come back by "
        "themselves within seconds. If it goes on, look at its messages: journalctl -u bunraku-console.",
    ),
    "sound": Fallback(
        "sound-died",
        "The sound's process died or hangs. The strings are silent, and it is started again within "
        "seconds. If it goes on, look at its messages: journalctl -u bunraku-sound.",
    ),
    "remote": Fallback(
        "remote-died",
        "The process for timecode and MIDI died or hangs. Cues wait for a GO by hand, and it is started "
        "again within seconds. If it goes on, look at its messages: journalctl -u bunraku-remote.",
    ),
}
STAGE_HUNG = Fallback(
    "stage-hung",
    "No frame came from the stage for half a second. Outputs pause, the picture fades to black; its watchdog "
    "starts it again, and the dance goes on where it was. If it goes on, look at its messages: "
    "journalctl -u bunraku-stage.",
)
COMMANDS_DROPPED = Fallback(
    "commands-dropped",
    "More commands came at once than show control carries out: the oldest gave way, without a reply. Panic, "
    "blackout, stop and go went before them, and the dance goes on. Check which desk sends this many.",
)
SHOW_REFUSED = Fallback(
    "show-refused", "A show or box file is broken and was refused; the last good one dances."
)
SHOW_PUT_ASIDE = Fallback(
    "show-put-aside", "A new show did not dance and was put aside; the one before it dances."
)
OF_THE_COMPANY = (*DIED.values(), STAGE_HUNG, COMMANDS_DROPPED, SHOW_REFUSED, SHOW_PUT_ASIDE)


class ProcessHealthWriter:
    """A process publishes its health once a second; without room for the block it works on without."""

    def __init__(self, folder: Path, process: str, fallbacks: Fallbacks) -> None:
        self.reported: dict[str, Any] = {}  # what else it says, for the page
        self._fallbacks = fallbacks
        self._due = 0.0
        self._block: BlockWriter | None = None
        record = _record(process)
        with contextlib.closing(record.reader(folder)) as block:
            before = _parsed(block.read())
        self._starts = 1 if before is None or before.get("ended") else int(before.get("starts", 0)) + 1
        with contextlib.suppress(OSError):
            self._block = record.writer(folder)

    def publish_health(self, now: float) -> None:
        """Call it often; monotonic seconds."""
        if now >= self._due:
            self._due = now + BEAT_S
            renew_lost()
            self._write(now, ended=False)

    def end(self, now: float) -> None:
        """It ends as it should; a process that only closes its block, after an error, counts as died."""
        self._write(now, ended=True)

    def close(self) -> None:
        if self._block is not None:
            self._block.close()
            self._block = None

    def _write(self, now: float, ended: bool) -> None:
        if self._block is None:
            return
        fallbacks, parts = self._fallbacks.happened(now), dict(self._fallbacks.parts)
        reported = dict(self.reported)
        values: dict[str, Any] = {"pid": os.getpid(), "starts": self._starts, "beat": now, "ended": ended}
        values |= {"fallbacks": fallbacks, "parts": parts, "reported": reported}
        packed = json.dumps(values).encode()
        while len(packed) > _LARGEST and (_halve_longest(fallbacks, parts) or _drop_longest(reported)):
            packed = json.dumps(values).encode()
        self._block.write(packed)


def _halve_longest(fallbacks: list[Fallen], parts: dict[str, str]) -> bool:
    """Cut the longest sentence: those of 32 universes do not fit. False: all are short."""
    sentences: list[tuple[str, int | str]] = [(one.message, place) for place, one in enumerate(fallbacks)]
    sentences += [(why, name) for name, why in parts.items()]
    longest, place = max(sentences, key=lambda one: len(one[0]), default=("", 0))
    if len(longest) <= _SHORT:
        return False
    half = f"{longest[: len(longest) // 2]}…"
    if isinstance(place, str):
        parts[place] = half
    else:
        fallbacks[place] = fallbacks[place]._replace(message=half)
    return True


def _drop_longest(reported: dict[str, Any]) -> bool:
    """Leave out the longest part of a report: names come from outside. False: nothing is left."""
    if reported:
        del reported[max(reported, key=lambda name: len(json.dumps(reported[name])))]
        return True
    return False


class Member(NamedTuple):
    """A process beside the stage. late: it published nothing for LATE_S, and did not end.

    parts: as in `Fallbacks`. lives: the process that published last is there. reported: what else it said.
    """

    process: str
    starts: int
    late: bool
    fallbacks: tuple[Fallen, ...]
    parts: dict[str, str]
    lives: bool = True
    reported: Mapping[str, Any] = MappingProxyType({})


class ProcessHealth:
    """The health that all of them published; never waits, never raises."""

    def __init__(self, folder: Path) -> None:
        self._blocks = {process: _record(process).reader(folder) for process in PROCESSES}
        self._chosen, self._chosen_at = folder / _CHOSEN, -1
        self._of_choice: tuple[Fallen, ...] = ()

    def members(self, now: float) -> list[Member]:
        """Processes that have run since power-on."""
        found = []
        for process, block in self._blocks.items():
            values = _parsed(block.read())
            if values is not None:
                late = not values.get("ended") and now - float(values.get("beat", now)) > LATE_S
                starts, fallbacks = int(values.get("starts", 1)), fallen(values.get("fallbacks"))
                found_parts = values.get("parts")
                parts = found_parts if isinstance(found_parts, dict) else {}
                parts = {str(name): str(why) for name, why in parts.items()}
                lives = block.writer_lives() and not values.get("ended")
                said = values.get("reported")
                more = said if isinstance(said, dict) else {}
                found.append(Member(process, starts, late, fallbacks, parts, lives, more))
        return found

    def reported(self, process: str, now: float) -> Mapping[str, Any]:
        """The rest of a process's report; empty where it does not live."""
        found = (one.reported for one in self.members(now) if one.process == process and one.lives)
        return next(found, MappingProxyType({}))

    def fallbacks(self, now: float) -> list[tuple[str, Fallen]]:
        """Process and fallback: what each published, whether it died, and shows that do not dance."""
        found = []
        for member in self.members(now):
            died = DIED[member.process]
            deaths = member.starts - 1 + member.late
            if deaths:
                found.append((member.process, Fallen(died.name, deaths, member.late, died.message)))
            found += [(member.process, one) for one in member.fallbacks]
        return found + [("preflight", one) for one in self._choice()]

    def close(self) -> None:
        for block in self._blocks.values():
            block.close()

    def _choice(self) -> tuple[Fallen, ...]:
        """Shows and box files that do not dance, as noted by the preflight and the stage."""
        try:
            changed = self._chosen.stat().st_mtime_ns
            if changed != self._chosen_at:
                self._chosen_at = changed
                values = stored_json(self._chosen)
                self._of_choice = tuple(_of_choice(values["refused"], values["aside"]))
        except (OSError, ValueError, KeyError, TypeError):
            self._of_choice = ()
        return self._of_choice


def _of_choice(refused: list[str], aside: list[list[str]]) -> list[Fallen]:
    """The preflight notes what it refused, the stage the pairs that it has put aside."""
    both = ((SHOW_REFUSED, refused), (SHOW_PUT_ASIDE, [message for _, message in aside]))
    return [
        Fallen(one.name, len(several), True, " ".join(several), _files_in(several))
        for one, several in both
        if several
    ]


def _files_in(sentences: list[str]) -> str:
    """The files that sentences begin with, as in 'show.yaml:3: ...', without their folders."""
    begun = (sentence.partition(": ") for sentence in sentences)
    names = (Path(file).name for file, colon, _ in begun if colon)
    return ", ".join(dict.fromkeys(name for name in names if " " not in name))


def _record(process: str) -> Record:
    return Record(f"{process}.health", "company", _LARGEST)


def _parsed(payload: bytes | None) -> dict[str, Any] | None:
    try:
        values = plain_json(payload) if payload else None
    except ValueError:
        return None
    return values if isinstance(values, dict) else None
