"""What is in force after an interruption: a power cut, a stage that was away, a restart, another show."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

import pytest

from appliance.box.show_state import ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, LIGHTS, LOOK, MASTER, PHRASE, SPRINGS
from appliance.show_control import order_dispatch
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, facts, until
from tests.show_control.in_force import declared, show_state


def test_after_a_power_cut_picture_and_lights_are_those_of_the_stages_cue(folder: Path) -> None:
    """Memory is empty, and the stage has found in the disk's place in which cue it was."""
    with StageDouble(folder) as stage:
        stage.tell(cue="storm")
        control = ControlInThread(folder)
        until(lambda: show_state(folder).cue == "storm")
        now = show_state(folder)
        assert (now[LOOK].value, now[LIGHTS].value, now[MASTER].value) == ("ink", "cold", 1.0)
        assert now[LOOK].share(time.monotonic()) == 1.0
        control.close()


def test_after_a_power_cut_the_springs_are_those_of_the_stages_cue(folder: Path) -> None:
    show = facts(cues=({"name": "gale", "springs": "storm", "fade_s": 2.0},), springs=("loose", "storm"))
    with StageDouble(folder, show) as stage:
        stage.tell(cue="gale")
        control = ControlInThread(folder)
        until(lambda: show_state(folder).cue == "gale")
        assert show_state(folder)[SPRINGS].value == "storm"
        control.close()


@pytest.mark.parametrize(
    ("left", "cue"),
    [
        (ShowState(show="A test").to(CUE, "1").to(LOOK, "lines"), "storm"),
        (ShowState(), "of another"),
    ],
)
def test_what_is_in_force_stays_whatever_the_stages_cue(folder: Path, left: ShowState, cue: str) -> None:
    with closing(ShowStateWriter(folder)) as writer:
        writer.write(left)
    with StageDouble(folder) as stage:
        stage.tell(cue=cue)
        control = ControlInThread(folder)
        asker = Asker(control.port)
        until(lambda: control.process.handler.status(0, time.monotonic()).state == "dancing")
        asker.ask("/ping")
        assert (show_state(folder).cue, show_state(folder)[LOOK].value) == (left.cue, left[LOOK].value)
        asker.close()
        control.close()


@pytest.mark.parametrize("lives", [True, False])
def test_what_is_declared_while_the_stage_is_away_is_in_force_and_the_reply_says_so(
    folder: Path, stage: StageDouble, asker: Asker, monkeypatch: pytest.MonkeyPatch, lives: bool
) -> None:
    monkeypatch.setattr(order_dispatch, "PATIENCE_S", 0.3)
    assert asker.ask("/cue", "1")[2] == 1
    stage.obeys = False
    if not lives:
        stage.__exit__(None, None, None)
        until(lambda: asker.ask_all("/status")[0][1] == "absent")
    message = "does not answer. The dance follows" if lives else "The dance begins with this"
    reply = asker.ask("/cue", "storm")
    assert reply[:3] == ["/reply", "/cue", 0] and message in reply[3]
    assert show_state(folder).cue == "storm" and declared(folder, PHRASE) == ("quiet", 4.0)


def test_what_was_in_force_stays_in_force_over_a_restart_and_is_said(folder: Path) -> None:
    first = ControlInThread(folder)
    asker = Asker(first.port)
    asker.ask("/panic")
    asker.ask("/master", 0.5)
    asker.close()
    first.close()
    second = ControlInThread(folder)
    assert second.said[-1:] == ["Still from before: Panic is in force: black, lights safe. /go lifts it."]
    assert show_state(folder).panic
    assert show_state(folder)[MASTER].value == 0.5
    second.close()


def test_names_that_another_show_has_left_are_forgotten(folder: Path) -> None:
    writer = ShowStateWriter(folder)
    left = ShowState(panic=True).to(CUE, "storm").to(LOOK, "lines").to(LOOK, "ink").to(LIGHTS, "cold")
    writer.write(left.to(PHRASE, "quiet", 1.0))
    writer.close()
    control = ControlInThread(folder)
    with StageDouble(folder, facts(looks=("ink", "glass"), cues=(), lights=())):
        until(lambda: show_state(folder).show == "A test")
        now = show_state(folder)
        assert now.panic and now.cue == "" and PHRASE not in now
        assert (now[LOOK].value, now[LOOK].before, now[LIGHTS].value) == ("ink", "", "")
    control.close()
