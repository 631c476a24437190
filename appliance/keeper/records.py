"""The records that the keeper mirrors: where the dance is, and what sensors have taught the box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from appliance.box.block import BlockReader
from appliance.box.checkpoint import PLACE, unpacked
from appliance.box.durable import private_folder
from appliance.box.fallback import Fallback
from appliance.box.record import SlotFile, WholeFile
from appliance.keeper.fallback import GESTURES_NOT_SAVED, PLACE_NOT_SAVED, SENSORS_NOT_SAVED
from appliance.keeper.mirror import reason_of
from appliance.sensor.gesture_memory import gesture_file, gesture_record
from appliance.sensor.memory import memory_file, memory_record


class MirroredRecord:
    """A record's file, which follows its block in the runtime folder."""

    def __init__(
        self,
        name: str,
        fallback: Fallback,
        block: BlockReader,
        state: Path,
        file: SlotFile | WholeFile,
        meaning: Callable[[bytes], object],
        message: str,
    ) -> None:
        """meaning: what of a payload has to differ before it is written again; None: it is none of ours.

        message: the complaint, with its `{reason}`.
        """
        self.name, self.fallback = name, fallback
        self.recovered = f"{state}: {name[0].lower()}{name[1:]} is kept there again."
        self._block, self.folder, self._file, self._meaning = block, state, file, meaning
        self._message = message
        self._on_disk: object = None
        self._folder: tuple[int, int] | None = None

    def copy(self, now: float) -> None:
        """Write what is new, or what another disk that is mounted there lacks."""
        payload = self._block.read()
        meaning = None if payload is None else self._meaning(payload)
        if payload is None or meaning is None:
            return
        private_folder(self.folder)
        found = self.folder.stat()
        if (found.st_dev, found.st_ino) != self._folder:
            self._on_disk = self._read_disk()
        self._folder = None
        if meaning != self._on_disk:
            self._file.write(payload)
            self._on_disk = meaning
        self._folder = found.st_dev, found.st_ino

    def explain(self, error: Exception) -> str:
        return self._message.replace("{reason}", reason_of(error))

    def close(self) -> None:
        self._block.close()
        self._file.close()

    def _read_disk(self) -> object:
        try:
            return next(map(self._meaning, self._file.read()), None)
        except ValueError:  # damaged: what the box knows replaces it
            return None


def mirrored_checkpoint(runtime: Path, state: Path) -> MirroredRecord:
    """runtime: the folder where the box's processes meet; state: the one on the disk."""

    def meaning(payload: bytes) -> object:
        place = unpacked(payload)
        return None if place is None else replace(place, tick=0)

    message = (
        f"{state}: the place of the dance cannot be kept there ({{reason}}). The dance goes on, even after a "
        "crash; after a power cut it begins at the beginning. Free or mend the disk, or give another folder "
        "as `state:` in the box file."
    )
    file = SlotFile(state / PLACE.name)
    name = "The place of the dance"
    return MirroredRecord(name, PLACE_NOT_SAVED, PLACE.reader(runtime), state, file, meaning, message)


def mirrored_sensor_memory(runtime: Path, state: Path) -> MirroredRecord:
    """The same folders."""
    message = (
        f"{state}: neutral poses and calibrations cannot be kept there ({{reason}}). The show goes on; after "
        "a power cut sensors need a moment of stillness again. Make the folder writable, or give another one "
        "as `state:` in the box file."
    )
    block, file = memory_record(state).reader(runtime), memory_file(state)
    return MirroredRecord("The sensors' memory", SENSORS_NOT_SAVED, block, state, file, bytes, message)


def mirrored_gestures(runtime: Path, state: Path) -> MirroredRecord:
    """The same folders."""
    message = (
        f"{state}: gestures cannot be kept there ({{reason}}). The show goes on; after a power cut gestures "
        "that were recorded today are gone. Make the folder writable, or give another one as `state:` in the "
        "box file."
    )
    block, file = gesture_record(state).reader(runtime), gesture_file(state)
    return MirroredRecord("The memory of gestures", GESTURES_NOT_SAVED, block, state, file, bytes, message)
