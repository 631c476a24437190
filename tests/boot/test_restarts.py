"""A stage that dies or hangs in the middle of a phrase dances again, where the phrase was."""

from __future__ import annotations

import signal
import time

import pytest

from appliance.box.checkpoint import Checkpoint
from tests.boot.box import STAGE, Box
from tests.boot.figures import Figures
from tests.boot.pauses import Seen, lives, missing_ticks, step_m
from tests.boot.spin import spin

KILLED_LIMIT_S, HUNG_LIMIT_S = 1.0, 3.0
KILLS = 12
WALKED_M = 0.6  # the phrase walks 0.56 m at most in half a second: a place is no older

pytestmark = pytest.mark.boot


def _goes_on(box: Box, before: Seen, after: Seen) -> None:
    """The phrase went on where it was, on the same spot of the stage, and the sensor is back."""
    assert step_m(before, after) < WALKED_M, (before, after)
    assert box.machine.show(STAGE, "ActiveState") == "active"
    box.await_sensor()


def test_a_killed_stage_goes_on_at_its_place(dancing: Box, figures: Figures) -> None:
    for _ in range(3):
        known = dancing.place()
        killed = dancing.machine.kill(STAGE)
        left = dancing.place()
        before, after = dancing.pause_from(killed)
        figures.note("SIGKILL to next frame", after.at - killed, limit=KILLED_LIMIT_S)
        _goes_on(dancing, before, after)
        if left.tick >= known.tick:  # else it had started over before the test looked
            _same_phrase(dancing, left, after)


@pytest.mark.parametrize("way", ["SIGSTOP", "busy spin", "SIGSEGV"])
def test_a_stage_that_hangs_or_crashes_is_restarted(dancing: Box, figures: Figures, way: str) -> None:
    harmed = _spin(dancing) if way == "busy spin" else dancing.machine.kill(STAGE, getattr(signal, way))
    before, after = dancing.pause_from(harmed)
    limit = KILLED_LIMIT_S if way == "SIGSEGV" else HUNG_LIMIT_S
    figures.note(f"{way} to next frame", after.at - harmed, limit=limit)
    _goes_on(dancing, before, after)
    if way == "busy spin":  # and leaves the line at which it hung
        dancing.machine.await_that(
            lambda: 'File "' in dancing.machine.log(STAGE).partition("Fatal Python error: Aborted")[2],
            "the journal does not say where it hung",
        )


def test_twelve_kills_in_a_row_do_not_make_it_give_up(dancing: Box, figures: Figures) -> None:
    left, ended = dancing.place(), time.time()
    for _ in range(KILLS):
        killed = dancing.machine.kill(STAGE)
        last, first = dancing.pause_from(killed, then_s=0.0)
        figures.note(f"each of {KILLS} kills in a row to next frame", first.at - killed, limit=KILLED_LIMIT_S)
        assert step_m(last, first) < WALKED_M, (last, first)
    after = dancing.await_frames(50, first.at)
    assert int(dancing.machine.show(STAGE, "NRestarts")) >= KILLS
    assert lives(after) == 1
    figures.note(f"ticks missing after {KILLS} kills", missing_ticks(after), limit=0, unit="ticks")
    now = dancing.place()
    assert (
        now.puppets[0].phrase == left.puppets[0].phrase
        and now.puppets[0].position_s - left.puppets[0].position_s < after[-1].at - ended
    )


def _same_phrase(box: Box, left: Checkpoint, first: Seen) -> None:
    """No tick of the phrase was lost or danced twice, however long the pause was. first: frame after it."""
    now = box.place()
    assert now.puppets[0].phrase == left.puppets[0].phrase
    if now.puppets[0].position_s > left.puppets[0].position_s:  # else it has come to its end and started over
        danced_s = box.danced_s(first.at, now.tick)
        assert now.puppets[0].position_s - left.puppets[0].position_s == pytest.approx(danced_s, abs=0.001), (
            left,
            now,
        )


def _spin(box: Box) -> float:
    """Make the stage spin; when."""
    return spin(box.machine.await_that(lambda: box.machine.main_pid(STAGE), "the stage does not run"))
