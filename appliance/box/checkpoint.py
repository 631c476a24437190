"""The checkpoint of the dance: what a restarted stage needs to go on where the last one was."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.record import Record, SlotFile
from appliance.pose.foreign_file import plain_json
from appliance.pose.possible import FARTHEST_ON_STAGE_M

LARGEST = 4000  # bytes of a packed checkpoint; one slot on the disk is a page of 4096
PLACE = Record("place", "place", LARGEST)
FILE = PLACE.name

_FORMAT = b"2\0"  # another one is of another release, and no place
_SHOW = struct.Struct("<qd2H3B")  # tick, rate, restarts, power cuts, ended, tries, puppets
_STANDING = struct.Struct("<8d2H")  # position, excerpt, standing, strayed, iterations
_MOST = 0xFFFF
_MOST_NUMBER = 1 << 62  # ticks and seeds may get this large; seconds and parameters stay far below


class Standing(NamedTuple):
    """Where a puppet is, right before the next tick.

    phrase, position_s: which pose comes next; excerpt: first and last second of the part that plays;
    standing: where the phrase's root stands on the stage, x, z (metres), heading (radians about +Y); strayed:
    how far grounding has moved the figure from there (metres); let_go: joints whose hands have let go; made:
    number of what was made ahead and is danced, whose seconds position_s then counts, else 0.
    """

    phrase: str
    position_s: float
    excerpt: tuple[float, float]
    standing: tuple[float, float, float] = (0.0, 0.0, 0.0)
    strayed: tuple[float, float] = (0.0, 0.0)
    coding: int = 1
    interaction: int = 0
    let_go: tuple[str, ...] = ()
    made: int = 0


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Where a show is, right before its next tick.

    rate: speed of its phrases while the show goes; source: what is to take the phrase's place, else "";
    applied: the generation of the show state that all this follows; boot: the machine's boot id; tick: of the
    last frame; restarts, power_cuts: how often the show went on after one; ended: the show was ended as it
    should; tries: starts from here that produced no frame; motion: parts of the show state for the generator,
    by name, with their values; liveliness: the level that was asked for last, the seed of the noise, and the
    absolute tick of this stage's tick 0.
    """

    show: str
    puppets: tuple[Standing, ...]
    rate: float = 1.0
    cue: str = ""
    boot: str = ""
    tick: int = 0
    restarts: int = 0
    power_cuts: int = 0
    ended: bool = False
    tries: int = 0
    applied: int = 0
    source: str = ""
    motion: tuple[tuple[str, tuple[float, ...]], ...] = ()
    liveliness: tuple[float, int, int] = (1.0, 0, 0)


def packed(place: Checkpoint) -> bytes:
    """A place as bytes, at most LARGEST; raises ValueError for names that are longer than that."""
    counts = min(place.restarts, _MOST), min(place.power_cuts, _MOST), place.ended, place.tries
    parts = [_FORMAT, _SHOW.pack(place.tick, place.rate, *counts, len(place.puppets))]
    parts += [
        _STANDING.pack(one.position_s, *one.excerpt, *one.standing, *one.strayed, one.coding, one.interaction)
        for one in place.puppets
    ]
    parts.append(
        _names(
            *(place.show, place.cue, place.boot, place.applied, place.source, place.motion, place.liveliness),
            tuple([(one.phrase, one.let_go, one.made) for one in place.puppets]),
        )
    )
    payload = b"".join(parts)
    if len(payload) > LARGEST and place.motion:
        return packed(replace(place, motion=()))  # the place counts for more
    if len(payload) > LARGEST:
        raise ValueError(f"A place of {len(payload)} bytes is longer than {LARGEST}.")
    return payload


def unpacked(payload: bytes) -> Checkpoint | None:
    """The place in these bytes; None for an unknown format and for numbers that no stage can have."""
    try:
        if not payload.startswith(_FORMAT):
            return None
        at = len(_FORMAT)
        tick, rate, restarts, power_cuts, ended, tries, puppets = _SHOW.unpack_from(payload, at)
        names_at = at + _SHOW.size + puppets * _STANDING.size
        show, cue, boot, applied, source, motion, (level, seed, begins_at), names = plain_json(
            payload[names_at:]
        )
        numbers = _STANDING.iter_unpack(payload[at + _SHOW.size : names_at])
        place = Checkpoint(
            str(show),
            tuple(_standing(*one) for one in zip(names, numbers, strict=True)),
            rate,
            str(cue),
            str(boot),
            tick,
            restarts,
            power_cuts,
            bool(ended),
            tries,
            int(applied),
            str(source),
            tuple((str(name), tuple(map(float, values))) for name, values in motion),
            (float(level), int(seed), int(begins_at)),
        )
    except (struct.error, ValueError, TypeError, OverflowError):
        return None
    metres: list[float] = []
    others: list[float] = [*place.liveliness, rate, tick, *(n for _, values in place.motion for n in values)]
    for puppet in place.puppets:
        metres += [*puppet.standing[:2], *puppet.strayed]
        others += [puppet.position_s, *puppet.excerpt, puppet.standing[2], puppet.made]
    is_possible = place.puppets and _are_within(metres, FARTHEST_ON_STAGE_M)
    return place if is_possible and _are_within(others, _MOST_NUMBER) else None


def _are_within(numbers: Iterable[float], most: float) -> bool:
    """Whether all are numbers, and none is larger than `most`."""
    return all(-most <= number <= most for number in numbers)


def _standing(names: Sequence[Any], numbers: tuple[float, ...]) -> Standing:
    phrase, let_go, made = names
    position_s, start_s, end_s, x, z, heading, strayed_x, strayed_z, coding, interaction = numbers
    return Standing(
        str(phrase),
        position_s,
        (start_s, end_s),
        (x, z, heading),
        (strayed_x, strayed_z),
        int(coding),
        int(interaction),
        tuple(map(str, let_go)),
        int(made),
    )


class CheckpointWriter:
    """The stage's end: the place in memory, renewed after each frame. Raises OSError without room for it.

    It costs some microseconds, waits for nothing, and outlives the process.
    """

    def __init__(self, folder: Path) -> None:
        self._block = PLACE.writer(folder)

    def write(self, place: Checkpoint) -> None:
        """Readers see this one from now on; raises ValueError as `packed` does."""
        self._block.write(packed(place))

    def close(self) -> None:
        """Release the file; it stays, with its last place."""
        self._block.close()


class CheckpointReader:
    """Reads the place in memory; the stage may be there or not.

    dropped: whether the last read found bytes that no stage can go on from.
    """

    dropped = False

    def __init__(self, folder: Path) -> None:
        self._block = PLACE.reader(folder)

    def read(self) -> Checkpoint | None:
        """The newest place; None where none was written. Never waits, never raises."""
        payload = self._block.read()
        place = None if payload is None else unpacked(payload)
        self.dropped = payload is not None and place is None
        return place

    def goes_on(self) -> bool:
        """Whether a show is on: a stage lives, and has not said that its show has ended. Never raises."""
        place = self.read()
        return place is not None and not place.ended and self.stage_lives()

    def stage_lives(self) -> bool:
        """Whether the stage that wrote what was read last is still there."""
        return self._block.writer_lives()

    def close(self) -> None:
        self._block.close()


def read_checkpoints(path: Path) -> tuple[list[Checkpoint], bool]:
    """The whole places on the disk, the newest first, and whether one was dropped. Never raises."""
    places = [unpacked(payload) for payload in SlotFile(path).read()]
    return [place for place in places if place is not None], None in places


def boot_id() -> str:
    """Which start of this machine it is; "" where the kernel does not say."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return ""


_packed_names: tuple[tuple[object, ...], bytes] = ((), b"")


def _names(*names: object) -> bytes:
    """They change seldom, and places are written at each tick: the last ones are kept."""
    global _packed_names
    if _packed_names[0] != names:
        _packed_names = names, json.dumps(names, ensure_ascii=False, separators=(",", ":")).encode()
    return _packed_names[1]
