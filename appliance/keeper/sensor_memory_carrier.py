"""Carries the sensors' memory from the runtime folder to the disk, in a process that may wait for a disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from appliance.box.private_file import replace_private
from appliance.sensor.memory_block import FILE_NAME, MemoryReader, text_on_disk

RETRY_S = 10.0


class MemoryCarrier:
    """Keeps the file of the state folder as the runtime folder's text is.

    complaint: why it cannot be kept now, a sentence, else "".
    """

    fallback = "sensors-not-kept"

    def __init__(self, runtime: Path, state: Path, say: Callable[[str], None]) -> None:
        """runtime: the folder where the box's processes meet; state: the one on the disk."""
        self._reader = MemoryReader(runtime, state)
        self._state, self._say = state, say
        self._kept: str | None = None  # in `_folder`
        self._folder: tuple[int, int] | None = None
        self._due = 0.0
        self.complaint = ""

    def turn(self, now: float) -> None:
        """Call it often; monotonic seconds. Waits as long as the disk does. Never raises."""
        if now >= self._due:
            self._due = now + self._carry()

    def last_turn(self) -> None:
        """Before the process ends: what is newest."""
        self._carry()
        self._reader.close()

    def _carry(self) -> float:
        """Bring what is new; seconds to wait until the next time."""
        text = self._reader.read()
        if text is None:
            return 0.0
        try:
            self._look_at_disk()
            if text != self._kept:
                replace_private(self._state / FILE_NAME, text)
                self._kept = text
        except OSError as error:
            self._folder = None
            self._complain(error)
            return RETRY_S
        if self.complaint:
            self.complaint = ""
            self._say(f"{self._state}: neutral poses and calibrations are kept there again.")
        return 0.0

    def _look_at_disk(self) -> None:
        """Know what the disk has; anew when another one has been mounted there."""
        self._state.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = self._state.stat()
        if (found.st_dev, found.st_ino) == self._folder:
            return
        try:
            self._kept = text_on_disk(self._state)
        except ValueError:  # damaged: what the box knows takes its place
            self._kept = None
        self._folder = found.st_dev, found.st_ino

    def _complain(self, error: OSError) -> None:
        complaint = (
            f"{self._state / FILE_NAME}: neutral poses and calibrations cannot be kept ({error.strerror}). "
            "The show goes on; after a power cut sensors need a moment of stillness again. "
            "Make the folder writable, or name another one under `state` in the box file."
        )
        if complaint != self.complaint:
            self._say(complaint)
        self.complaint = complaint
