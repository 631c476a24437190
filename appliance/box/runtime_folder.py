"""The runtime folder: where the processes of one box meet, in memory, closed to everybody else."""

from __future__ import annotations

import fcntl
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from appliance.show.box import BoxConfig

_OTHERS = 0o077
_CURE = "Give another folder as `runtime:` in the box file."


class RuntimeFolderError(Exception):
    """A folder in which the processes of a box cannot meet; the message says why and what to do."""


class AlreadyHereError(RuntimeFolderError):
    """Another living process has this place in the folder."""


def runtime_folder(box: BoxConfig, environment: Mapping[str, str] = os.environ) -> Path:
    """The box file's `runtime`, else systemd's, else the user session's, else one in shared memory.

    Made (mode 0700) when it is missing. Raises RuntimeFolderError where it is not this user's alone.
    """
    folder = box.runtime or _usual(environment)
    try:
        folder.mkdir(mode=0o700, parents=True)
    except FileExistsError:
        pass
    except OSError as error:
        raise RuntimeFolderError(
            f"{folder}: the folder where the box's processes meet cannot be made ({error.strerror}). "
            f"Nothing starts there. {_CURE}"
        ) from error
    _require_own(folder)
    return folder


def _usual(environment: Mapping[str, str]) -> Path:
    """systemd's folder for this unit ($RUNTIME_DIRECTORY may list several), the session's, or our own."""
    from_systemd = environment.get("RUNTIME_DIRECTORY", "").split(":")[0]
    if from_systemd:
        return Path(from_systemd)
    session = environment.get("XDG_RUNTIME_DIR", "")
    if session and Path(session).is_dir():
        return Path(session) / "bunraku"
    return Path(f"/dev/shm/bunraku-{os.getuid()}")


def _require_own(folder: Path) -> None:
    """Anybody may make a folder in shared memory first: only one that is this user's alone will do."""
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise RuntimeFolderError(
            f"{folder} is no folder (a file or a link), so the box's processes cannot meet there. "
            f"Nothing starts there. Remove it. {_CURE}"
        )
    if found.st_uid != os.getuid():
        raise RuntimeFolderError(
            f"{folder} belongs to another user (number {found.st_uid}), so the box's processes do not meet "
            f"there. Nothing starts there. {_CURE}"
        )
    if found.st_mode & _OTHERS:
        raise RuntimeFolderError(
            f"{folder} is open to other users (mode {stat.S_IMODE(found.st_mode):o}), so the box's processes "
            f"do not meet there. Nothing starts there. Run: chmod 700 {folder}. "
            "Or leave it out, and it is made."
        )


class Claim:
    """One living process a place: `Claim(folder, "stage")` holds it until it is closed or the process ends.

    Raises AlreadyHereError when another process holds it, RuntimeFolderError when the folder takes no file.
    """

    def __init__(self, folder: Path, place: str) -> None:
        path = folder / f"{place}.lock"
        try:
            self._descriptor = os.open(
                path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, mode=0o600
            )
        except OSError as error:
            raise RuntimeFolderError(
                f"{path}: cannot be opened ({error.strerror}). Nothing starts there. {_CURE}"
            ) from error
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._descriptor)
            raise AlreadyHereError(
                f"Another {place} runs in {folder}. It goes on, and this one does not start. Stop it, or "
                "give each box a folder of its own: `runtime:` in the box file."
            ) from None

    def close(self) -> None:
        """Give the place back."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1
