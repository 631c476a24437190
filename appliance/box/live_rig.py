"""The rig as it shines now: what the lights write a few times a second, and the page draws."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from appliance.box.block import BlockReader, BlockWriter

FILE, KIND, WRITER = "rig", "rig", "the lights (bunraku lights)"
LOOKED_AT = "rig.looked_at"  # touched by each who looks
WANTED_S = 2.0  # beams of 100 heads cost the lights 8 ms: nobody pays that while nobody looks
LARGEST = 1 << 16  # bytes; some 600 beams
MOST_BEAMS = 400
NOTHING = b'{"beams": [], "walk": ""}'


class LiveRigWriter:
    """The lights' end. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / FILE, KIND, LARGEST, fresh=True)
        self._looked_at = folder / LOOKED_AT
        self._touched, self._wanted_until = 0, -math.inf

    def is_wanted(self, now: float) -> bool:
        """Whether anybody looked within WANTED_S before `now` (monotonic seconds)."""
        with contextlib.suppress(OSError):
            touched = self._looked_at.stat().st_mtime_ns
            if touched != self._touched:  # the machine's clock may jump
                self._touched, self._wanted_until = touched, now + WANTED_S
        return now < self._wanted_until

    def write(self, beams: Sequence[Sequence[Any]], walk: str) -> None:
        """beams: of each the fixture's name, its place (x, y, z; metres), where it points (a unit vector),
        its colour (red, green, blue; 0..1), its level 0..1, its width in degrees; walk: what is walked now.
        """
        count, packed = MOST_BEAMS, _packed(beams[:MOST_BEAMS], walk)
        while count and len(packed) > LARGEST:  # long names, of which JSON makes six times as much
            count //= 2
            packed = _packed(beams[:count], walk)
        self._block.write(packed)

    def close(self) -> None:
        """Nothing shines any more."""
        self._block.write(NOTHING)
        self._block.close()


def _packed(beams: Sequence[Sequence[Any]], walk: str) -> bytes:
    return json.dumps({"beams": beams, "walk": walk}, separators=(",", ":")).encode()


class LiveRigReader:
    """The page's end, without numpy; never waits, never raises."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockReader(folder / FILE, KIND, writer=WRITER)
        self._looked_at = folder / LOOKED_AT

    def newest(self) -> bytes:
        """As JSON; nothing while no lights run."""
        with contextlib.suppress(OSError):
            self._looked_at.touch()
        read = self._block.read()
        return read if read is not None and self._block.writer_lives() else NOTHING

    def close(self) -> None:
        self._block.close()
