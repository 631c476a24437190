"""The checkpoint of the dance: what a restarted stage needs to go on where the last one was."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.record import Record, SlotFile
from appliance.pose.foreign_file import plain_json
from appliance.pose.possible import FARTHEST_ON_STAGE_M

LARGEST = 4000  # bytes of a packed checkpoint; one slot on the disk is a page of 4096
PLACE = Record("place", "place", LARGEST)
FILE = PLACE.name

_NUMBERS = struct.Struct("<q9d4HBB")
_OTHER = struct.Struct("<9d2H")  # another puppet: its places as above, its iterations
_ENDED = 1
_MOST = 0xFFFF
_MOST_NUMBER = 1 << 62  # ticks and seeds may get this large; seconds and parameters stay far below


class Standing(NamedTuple):
    """Where another puppet than the first is, right before the next tick; the same words as Checkpoint's."""

    phrase: str
    position_s: float
    excerpt: tuple[float, float]
    rate: float
    standing: tuple[float, float, float]  # x, z, heading
    strayed: tuple[float, float]
    coding: int
    interaction: int
    let_go: tuple[str, ...] = ()
    made: int = 0


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Where a show is, right before its next tick.

    phrase, position_s: which pose comes next; excerpt: first and last second of the part that plays;
    rate: its speed while the show goes; x, z (metres), heading (radians about +Y): where the phrase's root
    stands on the stage; strayed: how far grounding has moved the figure from there (metres); let_go: joints
    whose hands have let go; source: what is to take the phrase's place, else ""; applied: the generation of
    the show state that all this follows; boot: the machine's boot id; tick: of the last frame; restarts,
    power_cuts: how often the show went on after one; ended: the show was ended as it should; tries: starts
    from here that produced no frame; others: the puppets beside the first; motion: parts of the show state
    for the generator, by name, with their values; made: number of what was made ahead and is danced, whose
    seconds position_s then counts, else 0; liveliness: the level that was asked for last, the seed of the
    noise, and the absolute tick of this stage's tick 0; None: of another release.
    """

    show: str
    phrase: str
    position_s: float
    excerpt: tuple[float, float]
    rate: float = 1.0
    x: float = 0.0
    z: float = 0.0
    heading: float = 0.0
    strayed: tuple[float, float] = (0.0, 0.0)
    coding: int = 1
    interaction: int = 0
    cue: str = ""
    let_go: tuple[str, ...] = ()
    boot: str = ""
    tick: int = 0
    restarts: int = 0
    power_cuts: int = 0
    ended: bool = False
    tries: int = 0
    applied: int = 0
    source: str = ""
    others: tuple[Standing, ...] = ()
    motion: tuple[tuple[str, tuple[float, ...]], ...] = ()
    made: int = 0
    liveliness: tuple[float, int, int] | None = None


def packed(place: Checkpoint) -> bytes:
    """A place as bytes, at most LARGEST; raises ValueError for names that are longer than that."""
    numbers = _NUMBERS.pack(
        place.tick,
        place.position_s,
        *place.excerpt,
        place.rate,
        place.x,
        place.z,
        place.heading,
        *place.strayed,
        place.coding,
        place.interaction,
        min(place.restarts, _MOST),
        min(place.power_cuts, _MOST),
        _ENDED * place.ended,
        place.tries,
    )
    others = tuple([(other.phrase, other.let_go, other.made) for other in place.others])
    payload = numbers + _names(
        *(place.show, place.phrase, place.cue, place.let_go, place.boot, place.applied, place.source),
        *(others, place.motion, place.made, place.liveliness),
    )
    payload += b"\0" if others else b""
    for one in place.others:
        payload += _OTHER.pack(
            one.position_s, *one.excerpt, one.rate, *one.standing, *one.strayed, one.coding, one.interaction
        )
    if len(payload) > LARGEST and place.motion:
        return packed(replace(place, motion=()))  # the place counts for more
    if len(payload) > LARGEST:
        raise ValueError(f"A place of {len(payload)} bytes is longer than {LARGEST}.")
    return payload


def unpacked(payload: bytes) -> Checkpoint | None:
    """The place in these bytes; None for an unknown format and for numbers that no stage can have."""
    try:
        tick, position_s, start_s, end_s, rate, x, z, heading, strayed_x, strayed_z, *small = (
            _NUMBERS.unpack_from(payload)
        )
        names, numbers_of_others = _split(payload)
        show, phrase, cue, let_go, boot, applied, *later = plain_json(names)
        place = Checkpoint(
            str(show),
            str(phrase),
            position_s,
            (start_s, end_s),
            rate,
            x,
            z,
            heading,
            (strayed_x, strayed_z),
            small[0],
            small[1],
            str(cue),
            tuple(str(joint) for joint in let_go),
            str(boot),
            tick,
            small[2],
            small[3],
            bool(small[4] & _ENDED),
            small[5],
            int(applied),
            str(later[0]) if later else "",
            tuple(map(_standing, *later[1:2], numbers_of_others)) if later[1:] else (),
            tuple((str(name), tuple(map(float, values))) for name, values in later[2]) if later[2:] else (),
            int(later[3]) if later[3:] else 0,
            _liveliness(*later[4]) if later[4:] and later[4] else None,
        )
    except (struct.error, ValueError, TypeError, OverflowError):
        return None
    metres = [x, z, strayed_x, strayed_z]
    numbers = [*(place.liveliness or ()), position_s, start_s, end_s, rate, heading, tick, place.made]
    for one in place.others:
        metres += [*one.standing[:2], *one.strayed]
        numbers += [one.position_s, *one.excerpt, one.rate, one.standing[2], one.made]
    for _, values in place.motion:
        numbers += values
    is_possible = _are_within(metres, FARTHEST_ON_STAGE_M) and _are_within(numbers, _MOST_NUMBER)
    return place if is_possible else None


def _are_within(numbers: Iterable[float], most: float) -> bool:
    """Whether all are numbers, and none is larger than `most`."""
    return all(-most <= number <= most for number in numbers)


def _split(payload: bytes) -> tuple[bytes, list[tuple[float, ...]]]:
    """The names in a packed checkpoint, JSON without a zero byte, and the numbers of the other puppets."""
    names, _, behind = payload[_NUMBERS.size :].partition(b"\0")
    return names, list(_OTHER.iter_unpack(behind))


def _liveliness(level: Any, seed: Any, begins_at: Any) -> tuple[float, int, int]:
    return float(level), int(seed), int(begins_at)


def _standing(names: list[Any], numbers: tuple[float, ...]) -> Standing:
    position_s, start_s, end_s, rate, x, z, heading, strayed_x, strayed_z, coding, interaction = numbers
    phrase, let_go, *made = names
    return Standing(
        str(phrase),
        position_s,
        (start_s, end_s),
        rate,
        (x, z, heading),
        (strayed_x, strayed_z),
        int(coding),
        int(interaction),
        tuple(map(str, let_go)),
        int(*made),
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
        """Release the file."""
        self._block.close()


def read_checkpoint(path: Path) -> Checkpoint | None:
    """The newest whole place on the disk; None where there is none. Never raises."""
    return next(iter(read_checkpoints(path)[0]), None)


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
