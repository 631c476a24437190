"""The folders of a box with a stick that is plugged in, and preflights over them."""

from __future__ import annotations

import contextlib
import io
import json
import os
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
        """The command, in a fork: a process of its own would load its modules each time."""
        arguments = [*self.arguments, *more]

        def in_a_fork() -> bytes:
            _give_time()
            with (
                contextlib.redirect_stdout(io.StringIO()) as out,
                contextlib.redirect_stderr(io.StringIO()) as errors,
            ):
                try:
                    status = commands.main(arguments)
                except SystemExit as ended:
                    status = int(ended.code or 0)
            return json.dumps([status, out.getvalue(), errors.getvalue()]).encode()

        return subprocess.CompletedProcess(arguments, *json.loads(run_with_timeout(PATIENCE_S, in_a_fork)))

    @property
    def choice(self) -> Choice:
        return choice_in(self.run)

    @property
    def dances(self) -> str:
        return load_show(self.choice.first.show).config.name


def _give_time() -> None:
    """In a fork: a busy machine needs longer for a check than a power-on may take."""
    for limit in ("CHECK_S", "STICK_S", "TURN_S", "LATE_TURN_S"):
        setattr(commands, limit, PATIENCE_S)


def late(machine: Machine, uptime_s: float) -> list[str]:
    """As when a stick is plugged in; in a fork, where it may take its time: it asks for the lowest priority,
    at which other tests would leave it none.
    """

    def in_a_fork() -> bytes:
        lowered: list[int] = []
        setattr(os, "nice", lowered.append)  # noqa: B010
        _give_time()
        with contextlib.redirect_stdout(io.StringIO()) as out:
            assert preflight(machine.options._replace(late=True), uptime_s) == 0
        assert lowered == [19], "it takes time from the dance"
        return out.getvalue().encode()

    return run_with_timeout(PATIENCE_S, in_a_fork).decode().splitlines()
