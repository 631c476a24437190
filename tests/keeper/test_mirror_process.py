"""A mirror's process under the test's clock: what hangs is told, and killed and started again in the end."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.keeper.fallback import JOURNAL_STOPPED
from appliance.keeper.mirror_process import HANGS_S, STUCK_S, MirrorProcess
from tests.show_control.doubles import until

STEP_S = 0.5


class Stuck:
    """Its first copy never ends."""

    name, fallback, recovered = "A thing", JOURNAL_STOPPED, ""

    def __init__(self, path: Path) -> None:
        self._path = path

    def copy(self, now: float) -> None:
        with self._path.open("a") as file:
            file.write("turn\n")
        signal.pause()

    def explain(self, error: Exception) -> str:
        return str(error)

    def close(self) -> None:
        pass


class Watched:
    """The process of one that is stuck, and what was said of it."""

    def __init__(self, folder: Path) -> None:
        self.now, self.said, self._turns = 1000.0, list[str](), folder / "turns"
        self.process = MirrorProcess(Stuck(self._turns), folder, 0.0, self.said.append)

    @property
    def turns(self) -> int:
        return len(self._turns.read_text().splitlines()) if self._turns.exists() else 0

    def look_for(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now += STEP_S
            self.process.supervise(self.now)

    def goes_on(self) -> bool:
        """With the clock standing still: a start that takes long is no second silence."""
        self.process.supervise(self.now)
        return self.turns == 2


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Watched]:
    watched = Watched(tmp_path)
    watched.look_for(STEP_S)
    until(lambda: watched.turns == 1)
    yield watched
    watched.process.abandon()


def test_what_hangs_is_told_after_a_while_and_started_again_in_the_end(watched: Watched) -> None:
    watched.look_for(HANGS_S - STEP_S)
    assert watched.process.complaint == "" and watched.said == []
    watched.look_for(2 * STEP_S)
    assert "has not answered for 5 s" in watched.process.complaint
    watched.look_for(STUCK_S - HANGS_S - 2 * STEP_S)
    time.sleep(0.2)
    assert watched.turns == 1
    watched.look_for(3 * STEP_S)
    until(watched.goes_on)
    assert len(watched.said) == 2
    assert "has died" in watched.said[1]


def test_a_keeper_that_was_held_up_itself_blames_no_disk(watched: Watched) -> None:
    watched.now += 1000.0
    watched.process.supervise(watched.now)
    assert watched.process.complaint == ""
