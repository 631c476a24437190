"""Panic while the control port is flooded: from its datagram to the reply, when the picture is black."""

from __future__ import annotations

import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest

from tests.show_control.doubles import Asker, control_process
from tests.show_control.flood import KINDS, STRANGERS, stranger

GROUP = "/panic -> its reply, 10,000 other datagrams a second"
ROUNDS = 200
MEDIAN_S, OF_A_HUNDRED_S = 0.05, 0.25


@pytest.fixture
def flooded(folder: Path, tmp_path: Path) -> Iterator[Callable[[str], Asker]]:
    """Show control as the process that a box runs, a flood of this kind, and a console."""
    with ExitStack() as opened:

        def begin(kind: str) -> Asker:
            _, port = opened.enter_context(control_process(folder, tmp_path / "words.txt"))
            console = opened.enter_context(closing(Asker(port)))
            assert console.ask("/ping") == ["/pong"]
            if kind in KINDS:
                command = [sys.executable, "-m", "tests.show_control.flood", str(port), kind]
                flood = opened.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE))
                opened.callback(lambda: _end(flood))
                assert flood.stdout is not None and flood.stdout.readline()
            return console

        yield begin


def _end(flood: subprocess.Popen[bytes]) -> None:
    assert flood.poll() is None  # it was there to the end
    flood.kill()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "runtime"
    folder.mkdir(mode=0o700)
    return folder


@pytest.mark.parametrize("kind", ["nothing else", *KINDS])
def test_panic_in_a_flood(measured: Callable[..., Any], flooded: Callable[[str], Asker], kind: str) -> None:
    """50 ms in the median and 250 ms in 99 of 100 are the limit, and each is answered."""
    if kind == STRANGERS and not stranger():
        pytest.skip("This machine has no address from which a stranger could send.")
    console = flooded(kind)
    timed = measured(kind, GROUP, reference=kind not in KINDS)
    reply = timed.pedantic(console.ask, args=("/panic",), rounds=ROUNDS)
    assert reply[:3] == ["/reply", "/panic", 1]
    if timed.stats is not None:
        took_s = sorted(timed.stats.stats.data)
        assert statistics.median(took_s) < MEDIAN_S
        assert took_s[99 * ROUNDS // 100 - 1] < OF_A_HUNDRED_S
