"""A paired stage's message to its box's other processes: may they send; the leader's show state."""

from __future__ import annotations

import struct
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from appliance.box.block import BlockReader, BlockWriter
from appliance.box.show_state import ShowStateReader
from appliance.levers.show_state import ShowState, packed, unpacked

FILE, KIND = "pair", "pair"
STATE_FILE = "pair_state"
_PART = struct.Struct("<BBBBId")  # leads, speaks, is ready, peer lives; epoch; when it was written
_LARGEST_STATE = 16384
STALE_S = 0.07  # a stage whose last entry is older sends nothing


class BoxPart(NamedTuple):
    """leads: the other box follows this one. speaks: receivers get its frames; not while its cable is out.
    is_ready: it could take over. peer_lives: the other box was there when this was written, in monotonic
    seconds.
    """

    leads: bool
    speaks: bool
    is_ready: bool
    peer_lives: bool
    epoch: int
    written: float

    def may_speak(self, now: float) -> bool:
        """Whether lights may send: the stage speaks. One that died has handed over if the other box lives."""
        return self.speaks and (now - self.written < STALE_S or not self.peer_lives)


class PartWriter:
    """The stage's end. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._part = BlockWriter(folder / FILE, KIND, _PART.size, fresh=True)
        self._state = BlockWriter(folder / STATE_FILE, STATE_FILE, _LARGEST_STATE, fresh=True)

    def write(self, part: BoxPart) -> None:
        """Once a tick."""
        self._part.write(_PART.pack(*part))

    def write_state(self, state: ShowState) -> None:
        """The leader's show state, in times of this machine."""
        self._state.write(packed(state))

    def close(self) -> None:
        """Let go of the files."""
        self._part.close()
        self._state.close()


class PartReader:
    """The other processes' end; never waits, never raises. On a box without a pair it may always speak."""

    def __init__(self, folder: Path) -> None:
        self._part = BlockReader(folder / FILE, KIND)
        self._state = BlockReader(folder / STATE_FILE, STATE_FILE)
        self._state_read: tuple[bytes | None, ShowState | None] = None, None

    def read(self) -> BoxPart | None:
        """None: no stage of a pair has written here."""
        if (found := self._part.read()) is None or len(found) != _PART.size:
            return None
        leads, speaks, is_ready, peer_lives, epoch, written = _PART.unpack(found)
        return BoxPart(bool(leads), bool(speaks), bool(is_ready), bool(peer_lives), epoch, written)

    def state(self) -> ShowState | None:
        """The leader's show state, the same object until it changes."""
        found = self._state.read()
        if found != self._state_read[0]:
            self._state_read = found, None if found is None else unpacked(found)
        return self._state_read[1]

    def follows(self, now: float) -> bool:
        """Whether this box follows another one at this moment."""
        part = self.read()
        return part is not None and not part.leads and now - part.written < 1.0

    def close(self) -> None:
        """Let go of the files."""
        self._part.close()
        self._state.close()


class DarkWhileFollowing(ShowStateReader):
    """The show state for a projector that is black while its box follows the other one."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._part = PartReader(folder)
        self._seen = self._dark = ShowState(blackout=True)

    def read(self) -> ShowState:
        """The newest show state, dark where this box follows."""
        newest = super().read()
        if not self._part.follows(time.monotonic()):
            return newest
        if newest is not self._seen:
            self._seen, self._dark = newest, replace(newest, blackout=True)
        return self._dark

    def close(self) -> None:
        """Let go of the files."""
        super().close()
        self._part.close()


def forget_part(folder: Path) -> None:
    """A stage without a pair leaves none behind."""
    for name in (FILE, STATE_FILE):
        (folder / name).unlink(missing_ok=True)
