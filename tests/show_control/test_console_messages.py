"""What the box's terminal says about commands: once each, never a flood."""

from __future__ import annotations

import pytest

from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, GOING, LOOK, MASTER
from appliance.show_control.run import ConsoleMessages, held_back


def test_nothing_is_said_where_nothing_changes() -> None:
    news = ConsoleMessages(ShowState(panic=True).to(CUE, "storm"))
    assert news.look(ShowState(panic=True).to(CUE, "storm"), 0.0) == ""
    assert news.look(ShowState(panic=True).to(CUE, "storm").to(LOOK, "wires"), 1.0) == ""


@pytest.mark.parametrize(
    ("show_state", "message"),
    [
        (ShowState(panic=True), "Panic is in force: black"),
        (ShowState().to(GOING, 0.0), "The show is stopped: dark. /go"),
        (ShowState(blackout=True), "Blackout is in force. /blackout 0"),
        (ShowState().to(MASTER, 0.0), "Master is at 0 %: dark. /master 1"),
        (ShowState(panic=True, blackout=True).to(GOING, 0.0), "Panic"),
    ],
)
def test_why_it_is_dark_is_said_once_and_that_it_is_back(show_state: ShowState, message: str) -> None:
    news = ConsoleMessages(ShowState())
    assert news.look(show_state, 0.0).startswith(message) and held_back(show_state).startswith(message)
    assert news.look(show_state, 1.0) == ""
    assert news.look(ShowState(), 2.0) == "Picture and lights are back."
    assert held_back(ShowState()) == ""


def test_a_cue_is_said_with_what_it_changes() -> None:
    news = ConsoleMessages(ShowState())
    assert news.look(ShowState().to(CUE, "storm"), 0.0) == "Cue storm."
    assert news.look(ShowState().to(CUE, "end").to(MASTER, 0.0), 1.0).startswith("Cue end. Master is at 0 %")


def test_a_button_that_somebody_plays_with_is_no_flood() -> None:
    news = ConsoleMessages(ShowState())
    said = [
        message for step in range(500) if (message := news.look(ShowState(panic=step % 2 == 0), step * 0.01))
    ]
    assert len(said) <= 10
    assert news.look(ShowState(panic=True), 10.0) == "" or news.look(ShowState(), 20.0) != ""
