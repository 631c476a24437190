"""The first start of a box: the test card comes by itself, once, and gives way to the first sign of use."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from appliance.cli.app import parser
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE
from appliance.projector.run import MARK, SHOWS_FOR_S, FirstStart, Options, Run
from appliance.release.choice import Choice, ShowAndBox
from appliance.show.box import BoxConfig
from tests.bundles import write_show
from tests.logged import said
from tests.projector.stage_double import StageDouble

UNUSED = -1, ShowState(show="One hand")


def test_the_card_stays_until_its_time_is_over_and_never_comes_again(tmp_path: Path) -> None:
    first = FirstStart(tmp_path)
    assert first.is_on
    assert not first.is_over(100.0, *UNUSED) and not first.is_over(100.0 + SHOWS_FOR_S - 1, *UNUSED)
    assert FirstStart(tmp_path).is_on, "a projector that restarts shows it again"
    assert first.is_over(100.0 + SHOWS_FOR_S, *UNUSED)
    assert not first.is_on and not first.is_over(9e9, *UNUSED), "the card may be asked for again by hand"
    assert not FirstStart(tmp_path).is_on


@pytest.mark.parametrize(
    "sign",
    [(7, ShowState(), True), (-1, ShowState().to(CUE, "opening"), True), (-1, ShowState(), False)],
    ids=["a sensor", "a cue", "the card was taken off"],
)
def test_the_first_sign_of_use_ends_it(tmp_path: Path, sign: tuple[int, ShowState, bool]) -> None:
    first = FirstStart(tmp_path)
    assert not first.is_over(0.0, *UNUSED)
    assert first.is_over(1.0, *sign)
    assert (tmp_path / MARK).exists()


def test_it_does_not_come_where_the_box_was_used_or_can_keep_nothing(tmp_path: Path) -> None:
    keys, folder = tmp_path / "sensors.keys", tmp_path / "state"
    assert not FirstStart(folder).is_on, "it would come back at each power-on"
    folder.mkdir()
    assert FirstStart(folder, (keys, None)).is_on
    keys.touch()
    assert not FirstStart(folder, (keys, None)).is_on, "a sensor was paired"


def test_a_box_with_a_show_of_its_own_has_no_first_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Options] = []
    project_show: Callable[..., int] = lambda _, options, __: asked.append(options) or 0  # noqa: E731
    monkeypatch.setattr("appliance.cli.project.project_show", project_show)
    chosen, command = tmp_path / "chosen.json", parser("project").commands["project"]
    box = write_show(tmp_path / "show") / "box.yaml"
    box.write_text("{}")
    for one in (ShowAndBox(box=box), ShowAndBox(box=box, id="+b"), ShowAndBox(tmp_path, box, "s+b")):
        Choice((one,)).write(chosen)
        command.main(["--chosen", str(chosen)], standalone_mode=False)
    assert [options.is_first for options in asked] == [True, True, False]


def test_the_projector_shows_it_until_a_sensor_is_heard(tmp_path: Path) -> None:
    state = tmp_path / "state"
    state.mkdir()
    box = BoxConfig(runtime=tmp_path / "run", state=state)
    options = Options("offscreen", (64, 36), card=lambda: ("pin 123456",), is_first=True)
    with (
        closing(Run(box, options)) as run,
        closing(StageDouble(tmp_path / "run", write_show(tmp_path / "show"))) as stage,
    ):
        stage.write(time.monotonic())
        run.report(time.monotonic())
        assert run._controls.shows_test_card and "pin 123456" in run._card_lines and not said
        stage._frame.sensor_sequence = 3
        stage.write(time.monotonic())
        run.report(time.monotonic())
        assert not run._controls.shows_test_card
        assert said == ["The dance is on the wall."]
