"""The table of the boot tests at the end of a run, gathered from all processes that tested."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import pytest

from tests.boot.figures import Figures

NAME = "boot-figures"
VARIABLE = "BUNRAKU_FIGURES"


class FiguresReport:
    """A plugin. Files go into $BUNRAKU_FIGURES, else into `folder`.

    With $BUNRAKU_FIGURES the limits count; elsewhere a machine may be as busy as it likes.
    """

    def __init__(self, folder: Path) -> None:
        self.figures = Figures()
        self._folder = folder

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            output[NAME] = dataclasses.asdict(self.figures)
        elif VARIABLE in os.environ and self.figures.over() and exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Of pytest-xdist: one of the processes that tested has ended."""
        found = getattr(node, "workeroutput", {}).get(NAME)
        if found is not None:
            self.figures.add(Figures(**found))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.figures.values:
            terminalreporter.section("times of the boot tests")
            for line in self.figures.table():
                terminalreporter.write_line(line)
            self.figures.write(Path(os.environ.get(VARIABLE, self._folder)))
