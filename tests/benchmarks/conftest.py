"""After the benchmarks: the ratios as a table, and benchmarks.json beside the Makefile."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.benchmarks import table

JSON = "benchmarks.json"


@pytest.fixture
def measured(benchmark: Any) -> Callable[..., Any]:
    """Names a benchmark: measured('what', 'group'); reference=True where others are compared with it."""

    def named(label: str, group: str, reference: bool = False) -> Any:
        benchmark.group = group
        benchmark.extra_info.update(label=label, reference=reference)
        return benchmark

    return named


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    session = getattr(config, "_benchmarksession", None)
    if session is None or session.disabled or not session.benchmarks:
        return
    found = table.figures(session.benchmarks)
    terminalreporter.section("medians of this run, and how many times faster that is")
    for line in table.lines(found):
        terminalreporter.write_line(line)
    table.write(config.rootpath / JSON, found)
    terminalreporter.write_line(f"\nWritten to {JSON}.")
