"""The sensors' memory in the runtime folder: for the keeper, and for a stage that starts anew."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from appliance.box.block import BlockReader, BlockWriter
from appliance.pose.foreign_file import TooLargeError, content
from appliance.sensor.memory_text import LARGEST

FILE_NAME = "sensors.memory"  # in the state folder; in the runtime folder it is a block
_KIND = "sensors"
_CAPACITY = LARGEST + 4096  # and the name of a folder
_END_OF_NAME = b"\0"  # no path has one


class MemoryWriter:
    """The stage's end. Raises OSError without room for it."""

    def __init__(self, runtime: Path, state: Path) -> None:
        """runtime: the folder where the box's processes meet; state: the one on the disk that it is for."""
        self._name = _name(state)
        self._block = BlockWriter(runtime / FILE_NAME, _KIND, _CAPACITY)

    def write(self, text: str) -> None:
        """Readers see this text from now on; raises ValueError when it is too long."""
        self._block.write(self._name + _END_OF_NAME + text.encode())

    def close(self) -> None:
        """Let go of the file; it stays, with its last text."""
        self._block.close()


class MemoryReader:
    """Reads what was written last for this state folder; the stage may be there or not."""

    def __init__(self, runtime: Path, state: Path) -> None:
        self._name = _name(state)
        self._block = BlockReader(runtime / FILE_NAME, _KIND)

    def read(self) -> str | None:
        """The newest text; None where nothing was written for this folder. Never waits, never raises."""
        name, _, text = (self._block.read() or b"").partition(_END_OF_NAME)
        return text.decode(errors="replace") if name == self._name else None

    def close(self) -> None:
        """Let go of the file."""
        self._block.close()


def text_on_disk(state: Path) -> str | None:
    """What the state folder's file says, None without one. Raises OSError, ValueError for what is no text."""
    path = state / FILE_NAME
    try:
        return content(path, LARGEST).decode()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except TooLargeError as error:
        raise ValueError(error.strerror) from None


def forget_memory(runtime: Path, state: Path) -> None:
    """The box has ended: what the disk has is no longer needed in the runtime folder. Never raises.

    So a person may change or remove the file on the disk, and the next start reads that.
    """
    reader = MemoryReader(runtime, state)
    with contextlib.suppress(OSError, ValueError):
        text = reader.read()
        if text is not None and text == text_on_disk(state):
            (runtime / FILE_NAME).unlink()
    reader.close()


def _name(state: Path) -> bytes:
    return os.fsencode(state.absolute())
