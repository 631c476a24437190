"""A change from the page while a stick is checked: what people are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.box.durable import alone_in
from appliance.cli import box_file
from appliance.cli.app import refuse
from appliance.release.choice import CHOSEN, Choice, ShowAndBox


@pytest.mark.parametrize("busy", ["data", "run"])
def test_a_change_while_a_stick_is_checked_says_what_to_wait_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], busy: str
) -> None:
    for name in ("data", "run", "rehearsed"):
        (tmp_path / name).mkdir()
    chosen = tmp_path / "run" / CHOSEN
    Choice((ShowAndBox(),), data=tmp_path / "data").write(chosen)
    monkeypatch.setattr(box_file, "LATE_TURN_S", 0.0)
    for change in (
        lambda: box_file.dance_again(chosen, "a+b"),
        lambda: box_file.adopt_show(chosen, tmp_path / "rehearsed", "rehearsal"),
    ):
        with alone_in(tmp_path / busy), pytest.raises(SystemExit):
            try:
                change()
            except Exception as error:  # as page_calls.py does
                refuse(error)
        assert capsys.readouterr().err == (
            "bunraku: The box is checking a show from a stick. Try again in a few minutes.\n"
        )


def test_a_change_that_another_device_made_meanwhile_is_not_lost(tmp_path: Path) -> None:
    box = tmp_path / "box.yaml"
    box.write_text("limits: {tick_budget_ms: 10}\n")
    read = box_file.reported(box, None)["text"]
    first = box_file.Change(read, [(["control"], {"port": 9102})], read=read)
    assert not box_file.change(box, None, first)["problems"]
    written = box.read_text()
    second = box_file.Change(read, [(["limits", "tick_budget_ms"], 12)], read=read)
    (problem,) = box_file.change(box, None, second)["problems"]
    assert "changed the box file meanwhile" in problem["message"] and box.read_text() == written
    assert not box_file.change(box, None, second._replace(read=None))["problems"], "a program may do so"
