"""Made motion: what the generator made last for a puppet, on its way to the stage, and what it keeps."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import NamedTuple

from appliance.box.block import BlockReader, BlockWriter
from appliance.pose.foreign_file import plain_json

FOLDER = "material"  # in the runtime folder: what was made, as files
FILE, KIND = "made_motion", "made_motion"
NAMES_FILE, NAMES_KIND = "kept_motions", "kept_motions"
_LARGEST, _LARGEST_NAMES = 16384, 8192


class MadeMotion(NamedTuple):
    """recipe: JSON; file: its name in the runtime folder's `material`; name: of the source, or of what was
    kept. at_once: danced now, not at the next return. from_s: the second of what is danced
    from which it goes on; None: from none.
    """

    recipe: str
    file: str
    name: str
    at_once: bool
    from_s: float | None = None


class MadeMotionWriter:
    """The generator's end for one puppet, by its number. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path, puppet: int = 0) -> None:
        self._block = BlockWriter(_file(folder, puppet), KIND, _LARGEST, fresh=True)

    def write(self, made: MadeMotion) -> None:
        """Publish. Raises ValueError for a recipe that is too long."""
        self._block.write(json.dumps(made._asdict()).encode())

    def close(self) -> None:
        """Release the file; it stays."""
        self._block.close()


class MadeMotionReader:
    """The stage's end for one puppet. The same object until there is a newer one."""

    def __init__(self, folder: Path, puppet: int = 0) -> None:
        self._block = BlockReader(_file(folder, puppet), KIND, writer="the generator")
        self._payload: bytes | None = None
        self._made: MadeMotion | None = None

    def read(self) -> MadeMotion | None:
        """The last motion made, or None. Never waits, never raises."""
        payload = self._block.read()
        if payload is not None and payload != self._payload:
            self._payload, self._made = payload, _parsed(payload)
        return self._made

    def close(self) -> None:
        self._block.close()


class SavedNamesWriter:
    """The generator's end. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / NAMES_FILE, NAMES_KIND, _LARGEST_NAMES, fresh=True)

    def write(self, names: list[str]) -> None:
        """Publish the names of all motions that were kept."""
        self._block.write(json.dumps(names).encode())

    def close(self) -> None:
        """Release the file; it stays."""
        self._block.close()


class SavedNamesReader:
    """Show control's end: which motions can be called by name."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockReader(folder / NAMES_FILE, NAMES_KIND, writer="the generator")

    def read(self) -> tuple[str, ...]:
        """Never waits, never raises."""
        try:
            names = plain_json(self._block.read() or b"[]")
            return tuple(name for name in names if isinstance(name, str))
        except (ValueError, TypeError):
            return ()

    def close(self) -> None:
        self._block.close()


def forget_made_motion(folder: Path) -> None:
    """A show that ended as it should leaves nothing for the next one to take up."""
    shutil.rmtree(folder / FOLDER, ignore_errors=True)
    for file in (*folder.glob(f"{FILE}*"), folder / NAMES_FILE):
        file.unlink(missing_ok=True)


def _file(folder: Path, puppet: int) -> Path:
    return folder / (f"{FILE}_{puppet}" if puppet else FILE)


def _parsed(payload: bytes) -> MadeMotion | None:
    try:
        values = plain_json(payload)
        from_s = values.get("from_s")
        return MadeMotion(
            str(values["recipe"]),
            str(values["file"]),
            str(values["name"]),
            bool(values["at_once"]),
            None if from_s is None else float(from_s),
        )
    except (ValueError, LookupError, TypeError):
        return None
