"""Panic, stop, go and blackout over the real port: what is in force after each, and what lifts it."""

from __future__ import annotations

import time
from pathlib import Path

from appliance.levers.table import GOING, RATE
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, until
from tests.show_control.in_force import declared, show_state


def test_panic_is_in_force_when_the_reply_comes_and_go_lifts_it(
    folder: Path, stage: StageDouble, asker: Asker
) -> None:
    for command, lifting in ((["/panic"], ["/go"]), (["/panic", 1.0], ["/go", 1.0])):
        address, about, done, message = asker.ask(*command)
        assert (address, about, done) == ("/reply", "/panic", 1)
        assert "/go lifts it" in message
        assert show_state(folder).panic
        assert show_state(folder).level(time.monotonic()) == 0.0
        assert asker.ask(*lifting)[2] == 1
        assert not show_state(folder).panic
    assert show_state(folder).going


def test_a_button_let_go_changes_nothing_and_is_not_refused(
    control: ControlInThread, folder: Path, stage: StageDouble, asker: Asker
) -> None:
    asker.ask("/stop", 60.0)
    fade = show_state(folder)[GOING]
    assert "runs on" in asker.ask("/stop", 0.0)[3]
    assert show_state(folder)[GOING] == fade and fade.seconds == 60.0
    asker.ask("/panic", 1.0)
    address, about, done, message = asker.ask("/panic", 0.0)
    assert (address, about, done) == ("/reply", "/panic", 0)
    assert "let go" in message and "/go lifts a panic" in message
    assert "let go" in asker.ask("/go", 0.0)[3]
    assert show_state(folder).panic and not show_state(folder).going
    assert control.process.handler.refused == 0


def test_after_go_picture_and_lights_come_back_slowly(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/panic")
    asker.ask("/go")
    since = show_state(folder)[GOING].since
    assert [show_state(folder).level(since + t) for t in (0.0, 0.5, 1.0)] == [0.0, 0.5, 1.0]


def test_panic_needs_no_stage(folder: Path, asker: Asker) -> None:
    assert asker.ask("/panic")[2] == 1
    assert show_state(folder).panic


def test_a_slow_stop_can_be_made_a_quick_one(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/stop", 60.0)[2] == 1
    assert not show_state(folder).is_safe(time.monotonic() + 1.0)
    assert asker.ask("/stop", 0.1)[2] == 1
    assert show_state(folder).is_safe(time.monotonic() + 0.1)


def test_stop_fades_then_the_phrase_stands_until_go(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert asker.ask("/stop", 0.3)[2] == 1
    stopped = show_state(folder)
    assert not stopped.going
    assert [stopped.stands(stopped[GOING].since + t) for t in (0.0, 0.29, 0.31)] == [False, False, True]
    until(lambda: asker.ask("/stop")[3].startswith("The show stands still already"))
    assert asker.ask("/go")[2] == 1
    assert show_state(folder).going and not show_state(folder).stands(time.monotonic())


def test_after_go_the_phrase_plays_at_the_shows_rate(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.tell("/player/rate", 2.0)
    until(lambda: declared(folder, RATE) == (2.0, 0.0))
    asker.ask("/go")
    assert declared(folder, RATE) == (2.0, 0.0)  # it goes on already
    asker.ask("/stop", 0)
    asker.ask("/go")
    assert declared(folder, RATE) == (None, 0.0)
    asker.tell("/player/stop")
    until(lambda: declared(folder, RATE) == (0.0, 0.0))
    asker.ask("/go")
    assert declared(folder, RATE) == (None, 0.0)


def test_go_starts_a_show_that_stands_by_itself(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.ask("/go")
    assert declared(folder, RATE) is None
    stage.tell(state="stopped")
    until(lambda: asker.ask("/go")[2] == 1 and declared(folder, RATE) is not None)
    assert declared(folder, RATE) == (None, 0.0)


def test_blackout_is_dark_without_panic_and_go_does_not_lift_it(folder: Path, asker: Asker) -> None:
    assert asker.ask("/blackout", 1)[2] == 1
    assert show_state(folder).level(time.monotonic()) == 0.0
    assert not show_state(folder).is_safe(time.monotonic())
    assert "/blackout 0" in asker.ask("/go")[3]
    assert show_state(folder).blackout
    asker.ask("/blackout", 0)
    assert not show_state(folder).blackout
