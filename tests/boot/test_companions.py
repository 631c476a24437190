"""Whoever accompanies the stage may die or hang: it comes back, and the dance does not notice."""

from __future__ import annotations

import signal
import time

import pytest

from tests.boot.box import STAGE, Box
from tests.boot.figures import Figures
from tests.boot.pauses import lives, longest_pause_s, missing_ticks, share

# The projector's watchdog takes 10 s: those of the others show that they bite.
HARM = [("SIGKILL", name) for name in ("projector", "console", "control", "lights")]
HARM += [("SIGSTOP", name) for name in ("control", "lights", "console")]
DANCED = 0.1  # of the frames, on the busiest machine; a stage that waits for another process sends none

pytestmark = pytest.mark.boot


@pytest.mark.parametrize("way, name", HARM)
def test_the_dance_goes_on_without_noticing(dancing: Box, figures: Figures, way: str, name: str) -> None:
    machine, unit = dancing.machine, f"bunraku-{name}"
    stage = machine.main_pid(STAGE)
    began = time.time()
    dancing.await_unit(unit)
    process = machine.main_pid(unit)
    harmed = machine.kill(unit, getattr(signal, way))
    machine.await_that(lambda: machine.main_pid(unit) not in (0, process), f"{unit} does not come back")
    dancing.await_unit(unit)
    back = time.time()
    figures.note(f"{way} to a new {name}", back - harmed)
    dancing.hall.audience.watch(0.5)
    seen = [frame for frame in dancing.hall.audience.frames if frame.at > began]
    figures.note(f"ticks missing after {way} of the {name}", missing_ticks(seen), limit=0, unit="ticks")
    assert machine.main_pid(STAGE) == stage and lives(seen) == 1
    assert share(seen, harmed, back) > DANCED
    figures.note("longest time without frames while others are harmed", longest_pause_s(seen))


def test_show_control_answers_again_after_it_was_killed(dancing: Box) -> None:
    dancing.machine.kill("bunraku-control")
    answered = dancing.machine.await_that(
        lambda: [
            arguments
            for where, arguments in dancing.hall.ask("/status", 0.5)
            if where == "/bunraku/status/state"
        ],
        "show control does not answer",
    )
    assert answered[0][0] == "dancing"


def test_the_keeper_may_die_and_the_journal_goes_on(dancing: Box) -> None:
    machine = dancing.machine
    dancing.await_unit("bunraku-keeper")
    process = machine.main_pid("bunraku-keeper")
    began = machine.kill("bunraku-keeper")
    machine.await_that(
        lambda: machine.main_pid("bunraku-keeper") not in (0, process), "the keeper does not come back"
    )
    journal = machine.path("/data/bunraku/journal")
    machine.await_that(
        lambda: any(path.stat().st_mtime > began + 1.5 for path in journal.rglob("*") if path.is_file()),
        "the journal does not go on",
    )
    back = time.time()
    dancing.hall.audience.watch(0.2)
    seen = [frame for frame in dancing.hall.audience.frames if frame.at > began]
    assert lives(seen) == 1 and share(seen, began, back) > DANCED
