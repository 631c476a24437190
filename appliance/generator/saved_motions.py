"""Kept motions: what was danced once and is to come again, under a name, on the disk."""

from __future__ import annotations

import queue
import re
import threading
from pathlib import Path
from typing import Any

from appliance.box.durable import private_folder, write_whole
from appliance.dancer.material.material_file import (
    LARGEST,
    SUFFIX,
    Material,
    parsed_recipe,
    read_material,
)
from appliance.pose.foreign_file import content

FOLDER = "kept"  # in the state folder, and in the runtime folder
MOST = 16
_NAME = re.compile(r"[\w][\w .-]{0,63}")


class SavedMotions:
    """Motions in memory by name, and on disk: a separate thread writes, because a disk may hang.

    complaint: why the disk does not take one; "".
    """

    def __init__(
        self, runtime: Path, state: Path | None, joints: tuple[str, ...], taken: tuple[str, ...]
    ) -> None:
        """taken: names that mean something else. Reads what was kept."""
        self._memory, self._disk = runtime / FOLDER, None if state is None else state / FOLDER
        self._joints, self._taken = joints, taken
        self.complaint = ""
        self.recipes: dict[str, dict[str, Any]] = {}
        self._waiting: queue.Queue[tuple[Path, bytes]] = queue.Queue()
        self._read_folder(self._memory)
        if self._disk is not None:
            threading.Thread(target=self._serve_disk, name="kept", daemon=True).start()

    def keep(self, name: str, danced: Path) -> str:
        """Keep the motion of a file by this name; a sentence. Raises ValueError, and nothing is kept."""
        if not _NAME.fullmatch(name):
            raise ValueError("A name has 1 to 64 letters, digits, blanks, dots and dashes. Nothing is kept.")
        if name in self._taken:
            raise ValueError(f"'{name}' is a phrase or a source already. Give another name. Nothing is kept.")
        if name not in self.recipes and len(self.recipes) >= MOST:
            raise ValueError(
                f"{MOST} motions are kept already. Remove one from {self._disk}. Nothing is kept."
            )
        try:
            written = content(danced, LARGEST)
            recipe = parsed_recipe(read_material(danced, self._joints).recipe)
            self._memory.mkdir(mode=0o700, exist_ok=True)
            write_whole(self._memory / f"{name}{SUFFIX}", written, private=True)
        except (OSError, ValueError) as error:
            raise ValueError(f"The motion cannot be kept ({error}).") from None
        self.recipes[name] = recipe.get("of", recipe)
        if self._disk is None:
            return f"Kept as '{name}' until the box is switched off: it has no state folder (`state:`)."
        self._waiting.put((self._disk / f"{name}{SUFFIX}", written))
        return f"Kept as '{name}': /phrase {name} calls it."

    def material(self, name: str) -> Material:
        """Raises OSError, ValueError."""
        return read_material(self._memory / f"{name}{SUFFIX}", self._joints)

    def wait(self) -> None:
        """Wait until the disk has all of it."""
        self._waiting.join()

    def _read_folder(self, folder: Path) -> None:
        for file in sorted(folder.glob(f"*{SUFFIX}"))[:MOST]:
            self._read(file)

    def _read(self, file: Path) -> None:
        """Take in a file, if it is a motion of this figure."""
        name = file.name.removesuffix(SUFFIX)
        try:
            recipe = parsed_recipe(read_material(file, self._joints).recipe)
            if file.parent == self._disk:
                self._memory.mkdir(mode=0o700, exist_ok=True)
                write_whole(self._memory / file.name, content(file, LARGEST), private=True)
        except (OSError, ValueError) as error:
            self.complaint = f"{file}: this kept motion cannot be called ({error})."
            return
        if name not in self._taken:
            self.recipes[name] = recipe.get("of", recipe)

    def _serve_disk(self) -> None:
        """The thread: what the disk holds, then one file after the other, each until it is there."""
        assert self._disk is not None
        self._read_folder(self._disk)
        while True:
            path, written = self._waiting.get()
            try:
                private_folder(path.parent)
                write_whole(path, written, private=True)
                self.complaint = ""
            except OSError as error:
                self.complaint = (
                    f"{self._disk}: a kept motion cannot be written ({error.strerror}). It can be called "
                    "until the box is switched off."
                )
            self._waiting.task_done()
