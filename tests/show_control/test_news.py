"""What the box's terminal says about commands: once each, never a flood."""

from __future__ import annotations

from dataclasses import replace

import pytest

from appliance.box.show_state import House
from appliance.show_control.console_messages import News, held_back


def test_nothing_is_said_where_nothing_changes() -> None:
    news = News(House(panic=True, cue="storm"))
    assert news.look(House(panic=True, cue="storm"), 0.0) == ""
    assert news.look(replace(House(panic=True, cue="storm"), look="wires"), 1.0) == ""


@pytest.mark.parametrize(
    ("house", "words"),
    [
        (House(panic=True), "Panic is in force: black"),
        (House(going=False), "The show is stopped: dark. /go"),
        (House(blackout=True), "Blackout is in force. /blackout 0"),
        (House(master=0.0), "Master is at 0 %: dark. /master 1"),
        (House(panic=True, blackout=True, going=False), "Panic"),
    ],
)
def test_why_it_is_dark_is_said_once_and_that_it_is_back(house: House, words: str) -> None:
    news = News(House())
    assert news.look(house, 0.0).startswith(words) and held_back(house).startswith(words)
    assert news.look(house, 1.0) == ""
    assert news.look(House(), 2.0) == "Picture and lights are back."
    assert held_back(House()) == ""


def test_a_cue_is_said_with_what_it_changes() -> None:
    news = News(House())
    assert news.look(House(cue="storm"), 0.0) == "Cue storm."
    assert news.look(House(cue="end", master=0.0), 1.0).startswith("Cue end. Master is at 0 %")


def test_a_button_that_somebody_plays_with_is_no_flood() -> None:
    news = News(House())
    said = [words for step in range(500) if (words := news.look(House(panic=step % 2 == 0), step * 0.01))]
    assert len(said) <= 10
    assert news.look(House(panic=True), 10.0) == "" or news.look(House(), 20.0) != ""
