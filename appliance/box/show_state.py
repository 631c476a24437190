"""The show state in shared memory: written by show control, read by all processes."""

from __future__ import annotations

from pathlib import Path

from appliance.box.block import BlockWriter
from appliance.box.ring_file import RingFileReader
from appliance.levers.show_state import ShowState, packed, unpacked

FILE, KIND = "show_state", "show_state"
LARGEST = 16384  # bytes; the longest names of a show fit, in any script


class ShowStateReader:
    """Reads the show state of a runtime folder; before one is written the defaults hold: the show runs.

    An unchanged state costs a stat and eight bytes.

    A file that is gone stays in force until another one is written: panic stays panic when the folder is
    emptied, and what is dark does not flash up while a box ends.
    """

    def __init__(self, folder: Path) -> None:
        self._file = RingFileReader(folder / FILE, KIND, 1, "show control")
        self._sequence = 0
        self._show_state = ShowState()

    def read(self) -> ShowState:
        """The newest show state, the same object until it changes. Never waits, never raises."""
        if self._file.look():
            self._sequence = 0
        for ring in self._file.rings:
            if ring.newest_sequence() != self._sequence and (newest := ring.newest()):
                self._sequence, self._show_state = newest[0], unpacked(newest[1])
        return self._show_state

    def close(self) -> None:
        self._file.close()


class ShowStateWriter:
    """Show control's end: the file outlives it, so that panic stays panic. Raises OSError."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / FILE, KIND, LARGEST)

    def write(self, show_state: ShowState) -> None:
        """Publish; readers have it from their next read on."""
        self._block.write(packed(show_state))

    def close(self) -> None:
        """Let go of the file; it stays."""
        self._block.close()


def forget_show_state(folder: Path) -> None:
    """A show that ended as it should leaves nothing in force for the next one."""
    (folder / FILE).unlink(missing_ok=True)
