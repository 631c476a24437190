"""The folders of a box with a stick that is plugged in, and preflights over them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from appliance.cli import preflight as commands
from appliance.cli.preflight import Options, preflight
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.release.choice import CHOSEN, Choice
from appliance.show.bundle import write_checksums
from appliance.show.show import load_show
from tests.bundles import write_show
from tests.system.processes import run

PATIENCE_S = 120.0
PREFLIGHT = (sys.executable, "-m", "appliance.cli.preflight")


def choice_in(folder: Path) -> Choice:
    """The choice that a preflight has left in a folder."""
    choice = Choice.read(folder / CHOSEN)
    assert choice is not None
    return choice


class Machine:
    """The folders of a box, with a stick that is plugged in."""

    def __init__(self, folder: Path) -> None:
        self.boot, self.stick, self.data, self.run = (
            folder / name for name in ("boot", "stick", "data", "run")
        )
        for one in (self.boot, self.stick, self.data, self.run):
            one.mkdir()

    @property
    def arguments(self) -> list[str]:
        names = ("boot", "stick", "data", "run")
        return [f"--{name}={getattr(self, name)}" for name in names]

    @property
    def options(self) -> Options:
        return Options(self.boot, self.stick, self.data, self.run)

    def bring(self, name: str) -> Path:
        """Put a sound show of this name onto the stick."""
        show = write_show(self.stick / "show", name=name)
        write_checksums(show)
        return show

    def preflight(self, *more: str) -> subprocess.CompletedProcess[str]:
        return run([*PREFLIGHT, *self.arguments, *more], timeout=PATIENCE_S)

    @property
    def choice(self) -> Choice:
        return choice_in(self.run)

    @property
    def dances(self) -> str:
        return load_show(self.choice.first.show).config.name


def late(machine: Machine, uptime_s: float) -> list[str]:
    """As when a stick is plugged in; in a fork, because a late preflight lowers its own priority."""
    said: list[str] = []

    def in_a_fork() -> bytes:
        setattr(commands, "CHECK_S", PATIENCE_S)  # noqa: B010 - it runs at the lowest priority
        assert preflight(machine.options._replace(late=True), said.append, uptime_s) == 0
        return "\n".join(said).encode()

    return run_with_timeout(PATIENCE_S, in_a_fork).decode().splitlines()
