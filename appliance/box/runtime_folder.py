"""The runtime folder: where the processes of one box meet, in memory, closed to everybody else."""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Protocol
from weakref import WeakSet

from appliance.box.durable import private_folder
from appliance.pose.correctable_error import CorrectableError

if TYPE_CHECKING:
    from appliance.show.box import BoxConfig

_OTHERS = 0o077
_CURE = "Give another folder as `runtime:` in the box file."


class RuntimeFolderError(CorrectableError):
    """A folder in which the processes of a box cannot meet; the message says why and what to do."""


class AlreadyHereError(RuntimeFolderError):
    """Another living process has this place in the folder."""


def runtime_folder(box: BoxConfig, environment: Mapping[str, str] = os.environ) -> Path:
    """The box file's `runtime`, else systemd's, else the user session's, else one in shared memory.

    Made (mode 0700) when it is missing. Raises RuntimeFolderError unless it belongs only to this user.
    """
    folder = box.runtime or _usual(environment)
    try:
        private_folder(folder)
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
    """Anybody may make a folder in shared memory first, so only one that belongs to this user is accepted."""
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


class Renewable(Protocol):
    """The files of a process in the runtime folder, which it can put there again."""

    def renew(self) -> bool:
        """Whether it was lost and is there again. Raises OSError where the folder does not take it."""
        ...


_HELD: WeakSet[Renewable] = WeakSet()
_HOLDING = threading.Lock()


def hold(one: Renewable) -> None:
    """From now on `renew_lost` looks after it, for as long as it lives."""
    with _HOLDING:
        _HELD.add(one)


def renew_lost() -> str | None:
    """Once a second: put everything of this process that was deleted from the folder there again.

    None: nothing was. "": it is there again. Else why it is not, for people.
    """
    with _HOLDING:
        held = list(_HELD)
    found: str | None = None
    for one in held:
        try:
            if one.renew() and found is None:
                found = ""
        except OSError as error:
            found = f"{error.filename or 'The runtime folder'} cannot be made again ({error.strerror})."
    return found


def is_lost(path: Path) -> bool:
    """Whether nothing is there; the folder is made again (mode 0700) where it is gone too."""
    try:
        path.lstat()
    except FileNotFoundError:
        private_folder(path.parent)
        return True
    return False


@contextlib.contextmanager
def restored_file(path: Path) -> Iterator[None]:
    """Inside, a small file that nobody writes a second time is remembered, and put there again."""
    one = _RestoredFile(path)
    with contextlib.suppress(OSError):
        one.renew()
    hold(one)
    yield


class _RestoredFile:
    def __init__(self, path: Path) -> None:
        self._path, self._changed, self._content = path, -1, b""

    def renew(self) -> bool:
        if self._content and is_lost(self._path):
            with contextlib.suppress(FileExistsError), self._path.open("xb") as file:
                os.fchmod(file.fileno(), 0o600)
                file.write(self._content)
            return True
        with contextlib.suppress(FileNotFoundError):
            if (changed := self._path.stat().st_mtime_ns) != self._changed:
                self._changed, self._content = changed, self._path.read_bytes()
        return False


class Claim:
    """One living process a place: `Claim(folder, "stage")` holds it until it is closed or the process ends.

    Raises AlreadyHereError when another process holds it, RuntimeFolderError when the folder takes no file.
    """

    def __init__(self, folder: Path, place: str) -> None:
        self._path, self._descriptor = folder / f"{place}.lock", -1
        try:
            self._take()
        except BlockingIOError:
            raise AlreadyHereError(
                f"Another {place} runs in {folder}. It goes on, and this one does not start. Stop it, or "
                "give each box another folder: `runtime:` in the box file."
            ) from None
        except OSError as error:
            raise RuntimeFolderError(
                f"{self._path}: cannot be opened ({error.strerror}). Nothing starts there. {_CURE}"
            ) from error
        hold(self)

    def renew(self) -> bool:
        """As in `Renewable`; a place that another process has taken meanwhile is left to it."""
        if self._descriptor < 0 or not is_lost(self._path):
            return False
        with contextlib.suppress(BlockingIOError):
            self._take()
        return True

    def _take(self) -> None:
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        descriptor = os.open(self._path, flags, mode=0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise
        self.close()
        self._descriptor = descriptor

    def close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1
