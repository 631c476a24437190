"""A fault that was recorded once dances today as it did then, and its journal tells what happened."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.cli.pictures import load_dance
from appliance.cli.replay import TOLERANCE_DEGREES
from appliance.cli.replay import replay as replay_journal
from appliance.recorder.journal_reader import Run, read_journal
from appliance.recorder.record import NOT_FINITE, RESENT
from appliance.show.show import load_show
from appliance.stage.comparison import Comparison
from appliance.stage.replay import Replay
from tests.bundles import FIGURE
from tests.recorder.make_golden_journal import (
    AFTER,
    BEFORE,
    FAILED,
    GOLDEN,
    LATE,
    SILENT,
    write_faulty_show,
)


@pytest.fixture(scope="module")
def runs() -> tuple[Run, ...]:
    return read_journal(GOLDEN).runs


def test_the_fault_dances_again_as_it_was_recorded(
    runs: tuple[Run, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    show = write_faulty_show(tmp_path / "show")
    for run in runs:
        replay = Replay(run, load_show(show))
        comparison = Comparison(float(run.ticks["frame_time"][0]), TOLERANCE_DEGREES)
        assert [*replay.dance(comparison)][-1] == len(run.ticks)
        assert comparison.first is None, comparison.first.sentence()
        assert (replay.skipped, replay.forced) == (0, 0)
    assert replay_journal(GOLDEN, show, 0.0, TOLERANCE_DEGREES) == 0
    assert f"Run 2 of 'A test': {AFTER} ticks danced again" in capsys.readouterr().out


def test_it_tells_what_happened(runs: tuple[Run, ...]) -> None:
    before, after = runs
    assert (len(before.ticks), len(after.ticks)) == (BEFORE, AFTER)
    flags = before.ticks["flags"]
    assert np.flatnonzero(flags & NOT_FINITE).tolist() == [*FAILED]
    assert np.flatnonzero(flags & RESENT).tolist() == [*LATE]
    assert np.flatnonzero(before.ticks["reading_here"][:, 0] == 0).tolist() == [*SILENT]
    weights = before.ticks["weights"][:, 0]
    assert weights[SILENT.start] == 1.0 and weights[SILENT.stop - 1] < 0.05  # given back over a second
    assert [event["order"]["name"] for _, event in before.events] == ["neutral", "iterations", "iterations"]
    assert load_dance(GOLDEN).part(-1.0, 1.0).recordings[0].poses.shape == (50, len(FIGURE), 4)


def test_while_nothing_could_be_danced_the_last_good_pose_stood(runs: tuple[Run, ...]) -> None:
    poses = runs[0].ticks["pose"]
    assert np.isfinite(poses).all()
    for troubled in (FAILED, LATE):
        assert (poses[troubled.start : troubled.stop] == poses[troubled.start - 1]).all()
