"""The host under examination: its file system, the venue's box file, and the stage, where one dances."""

from __future__ import annotations

import contextlib
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from appliance.box.child import finished
from appliance.box.fallback import Fallen, fallen
from appliance.box.mounts import Mount, mounts
from appliance.box.process_health import Member, ProcessHealth
from appliance.box.runtime_folder import RuntimeFolderError, runtime_folder
from appliance.outputs.frame_reader import FrameReader
from appliance.release.choice import RUN
from appliance.show.box import BoxConfig

_ASK_S = 2.0


@dataclass(frozen=True)
class RunningStage:
    """The stage that dances here: its process, and what it last said about itself."""

    pid: int
    health: dict[str, Any]
    fallbacks: tuple[tuple[str, Fallen], ...] = ()  # all processes of the box: the process, the fallback
    members: tuple[Member, ...] = ()  # the processes beside it
    show: Path | None = None  # the folder of what it dances

    @property
    def key_file(self) -> Path | None:
        """The sensors' key file that its show control reads; None: not known."""
        read = (
            one.reported.get("key_file") for one in self.members if one.process == "control" and one.lives
        )
        return Path(found) if (found := next(read, None)) else None


@dataclass(frozen=True)
class HostView:
    """A machine seen from `root`: what /proc, /sys and /etc say is read from there.

    `is_here`: it is this machine, so its clock, ports and processor can be examined too. Nothing here raises
    for a missing or unreadable file.
    """

    root: Path = Path("/")
    box: BoxConfig = field(default_factory=BoxConfig)
    stage: RunningStage | None = None

    @property
    def is_here(self) -> bool:
        return self.root == Path("/")

    def at(self, path: Path | str) -> Path:
        """This absolute path of the machine, below `root`."""
        return self.root / str(path).lstrip("/")

    def text(self, path: Path | str) -> str | None:
        """The text of a file, stripped; None if it cannot be read or is empty."""
        try:
            return self.at(path).read_text(errors="replace").strip()
        except OSError:
            return None

    def number(self, path: Path | str) -> int | None:
        """The number in a file, decimal or with 0x."""
        try:
            return int(self.text(path) or "", 0)
        except ValueError:
            return None

    def found(self, pattern: str) -> list[Path]:
        """Files of this pattern, in order, as paths of the machine."""
        with contextlib.suppress(OSError):
            return [
                Path("/") / path.relative_to(self.root)
                for path in sorted(self.root.glob(pattern.lstrip("/")))
            ]
        return []

    def is_bunraku(self, process: Path) -> bool:
        """Whether Python runs the box there: one of its modules, or the script `bunraku` that is its command.

        The program's folder proves nothing: everything started in a checkout has the same one.
        """
        program, *arguments = (self.text(process / "cmdline") or "").split("\0")
        if not Path(program).name.startswith("python"):
            return False
        while arguments and arguments[0].startswith("-") and arguments[0] != "-m":
            del arguments[: 1 + (arguments[0] in ("-W", "-X"))]  # these two options take the next word
        if arguments[:1] == ["-m"]:
            return arguments[1:2] == ["appliance"] or "".join(arguments[1:2]).startswith("appliance.")
        return Path("".join(arguments[:1])).name == "bunraku"

    def mounts(self) -> list[Mount]:
        """The mounted file systems, in the order of mounting."""
        return mounts(self.text("/proc/self/mountinfo") or self.text("/proc/mounts") or "")


def running_stage(box: BoxConfig) -> RunningStage | None:
    """The stage of this box, if one runs; root also looks in the folder of the box's own user."""
    folder = box.runtime
    if folder is None and os.access(RUN / "frame", os.F_OK):  # False where RUN is closed to this user
        folder = RUN
    if folder is None:
        try:
            folder = runtime_folder(box)
        except RuntimeFolderError:
            return None
    with contextlib.closing(FrameReader(folder)) as reader:
        if not reader.is_alive(time.monotonic()) or reader.facts is None:
            return None
        health, now = reader.health() or {}, time.monotonic()
        with contextlib.closing(ProcessHealth(folder)) as shared:
            reported = [("stage", one) for one in fallen(health.get("fallbacks"))] + shared.fallbacks(now)
            members = tuple(shared.members(now))
        return RunningStage(reader.facts.pid, health, tuple(reported), members, reader.facts.show_directory)


def output_of(*command: str) -> str:
    """The output of a program on this machine; "" if it is missing or does not answer."""
    return finished(command, _ASK_S).stdout
