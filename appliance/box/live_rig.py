"""The rig as it shines now: what the lights write a few times a second, and the page draws."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from appliance.box.block import BlockReader, BlockWriter

FILE, KIND, WRITER = "rig", "rig", "the lights (bunraku lights)"
LARGEST = 1 << 16  # bytes; some 600 beams
MOST_BEAMS = 400
NOTHING = b'{"beams": [], "walk": ""}'


class LiveRigWriter:
    """The lights' end. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / FILE, KIND, LARGEST, fresh=True)

    def write(self, beams: Sequence[Sequence[Any]], walk: str) -> None:
        """beams: of each the fixture's name, its place (x, y, z; metres), where it points (a unit vector),
        its colour (red, green, blue; 0..1), its level 0..1, its width in degrees; walk: what is walked now.
        """
        told = {"beams": beams[:MOST_BEAMS], "walk": walk}
        self._block.write(json.dumps(told, separators=(",", ":")).encode())

    def close(self) -> None:
        """Nothing shines any more."""
        self._block.write(NOTHING)
        self._block.close()


class LiveRigReader:
    """The page's end, without numpy; never waits, never raises."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockReader(folder / FILE, KIND, writer=WRITER)

    def newest(self) -> bytes:
        """As JSON; nothing while no lights run."""
        read = self._block.read()
        return read if read is not None and self._block.writer_lives() else NOTHING

    def close(self) -> None:
        """Release the file."""
        self._block.close()
