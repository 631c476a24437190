"""What the page tells of the box is read from shared memory, and is what show control answers to a desk."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from appliance.box.roster import RosterLine
from appliance.box.show_state import ShowStateReader
from appliance.console.box_view import BoxView
from appliance.console.desk import NO_COMMANDS, SILENT, Desk
from appliance.console.seen_stage import SeenStage
from appliance.console.stage_view import StageView
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, until

LINE = RosterLine(
    "left-wrist", "0000002a", "linked", "udp", 50.0, 0.01, 0.002, 0.01, 80, 255, 0, "1", "imu", "", ""
)


@pytest.fixture
def view(tmp_path: Path) -> Iterator[BoxView]:
    stage = StageView(tmp_path)
    seen = SeenStage(tmp_path, stage)
    yield BoxView(Desk(("127.0.0.1", 9)), stage, seen, ShowStateReader(tmp_path))
    seen.close()
    stage.close()


def test_the_page_tells_what_a_desk_is_answered(tmp_path: Path, view: BoxView) -> None:
    control = ControlInThread(tmp_path)
    with StageDouble(tmp_path) as stage, closing(Asker(control.port)) as asker:
        stage.tell(phrase="quiet", let_go=["lShldr"], coding=8, seed=7, liveliness=0.25, sensors=[LINE])
        until(lambda: asker.ask("/cue", "storm")[2] == 1)
        asker.ask("/look", "plastr")  # refused
        refused = control.process.handler.refused

        def is_told() -> bool:
            """Show control publishes once a second."""
            view.refresh()
            return view.value["status"] is not None and view.value["status"]["refused"] == refused

        until(is_told)
        reported = view.value
        answered = asker.status()._asdict()
        for changing in ("level", "uptime_s"):
            answered.pop(changing), reported["status"].pop(changing)
        assert reported["status"] == {name: pytest.approx(value) for name, value in answered.items()}
        for question in ("cues", "phrases", "looks", "cards"):
            *answers, _ = asker.ask_all(f"/{question}")
            assert [[one["name"], int(one["now"])] for one in reported[question]] == [
                one[1:] for one in answers
            ]
        assert reported["hands"] == [
            {"joint": "lShldr", "source": "left-wrist", "holds": False, "by": "orientation"}
        ]
        (sensor,) = reported["sensors"]
        assert (sensor["name"], sensor["battery"], sensor["heard"]) == ("left-wrist", 80, True)
        assert (reported["frames"], reported["trouble"]) == ("fresh", "")
    control.close()


def test_without_show_control_the_page_says_so(tmp_path: Path, view: BoxView) -> None:
    view.refresh()
    assert (view.value["trouble"], view.value["status"], view.value["hands"]) == (SILENT, None, [])
    control = ControlInThread(tmp_path)
    until(lambda: (view.refresh(), view.value["status"])[1] is not None)
    control.close()
    view.refresh()
    assert view.value["trouble"] == SILENT
    stage = StageView(tmp_path)
    none = BoxView(Desk(None), stage, SeenStage(tmp_path, stage), ShowStateReader(tmp_path))
    none.refresh()
    assert none.value["trouble"] == NO_COMMANDS and not none.value["control"]
