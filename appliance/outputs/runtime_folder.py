"""The runtime folder: where the processes of one box meet, in memory, closed to everybody else."""

from __future__ import annotations

import fcntl
import os
import stat
from pathlib import Path

from appliance.show.box import BoxConfig


class RuntimeFolderError(Exception):
    """A folder in which the processes of a box cannot meet; the message says why and what to do."""


class AlreadyHereError(RuntimeFolderError):
    """Another living process has this place in the folder."""


def runtime_folder(box: BoxConfig) -> Path:
    """The box file's `runtime`, else systemd's, else the user session's, else one in shared memory.

    Made (mode 0700) when it is missing. Raises RuntimeFolderError where it is not this user's alone.
    """
    raise NotImplementedError


class Claim:
    """One living process a place: `Claim(folder, "stage")` holds it until it is closed or the process ends.

    Raises AlreadyHereError when another process holds it, RuntimeFolderError when the folder takes no file.
    """

    def __init__(self, folder: Path, place: str) -> None:
        raise NotImplementedError

    def close(self) -> None:
        """Give the place back."""
