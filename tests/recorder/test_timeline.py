"""A night at a glance, and a stretch of it for the page."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from appliance.cli import page_calls
from appliance.recorder.export import export_stretch
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import Run, read_journal, segments_of
from appliance.recorder.segments import SEGMENT_TICKS
from appliance.recorder.timeline import EVERY, MOST_BINS, stretch, timeline
from tests.bundles import write_show
from tests.command import Command
from tests.recorder.night import Night


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Six seconds; in the third one ten ticks were late."""
    folder = tmp_path_factory.mktemp("night")
    night = Night(write_show(folder / "show"), folder / "runtime")
    night.dance(110)
    night.dance(10, late_s=0.012)
    night.dance(180)
    return read_journal(night.saved(folder / "journal")).runs[-1]


def test_what_was_late_stands_where_it_was(run: Run) -> None:
    night = timeline(1, run)
    assert night["bin_s"] == 1.0
    assert night["late"] == [0, 0, 10, 0, 0, 0]
    assert night["seconds"] == pytest.approx(6.0, abs=0.05)
    assert all(ms > 0 for ms in night["slowest_ms"])
    json.dumps(night)


def test_a_long_night_has_no_more_bins(run: Run) -> None:
    long = Run(run.header, run.ticks.copy(), run.tick_numbers, run.events, run.keyframes)
    long.ticks["frame_time"] = np.linspace(0.0, 90_000.0, len(run.ticks))
    assert len(timeline(1, long)["late"]) == MOST_BINS
    assert sum(timeline(1, long)["late"]) == 10


def test_a_stretch_is_danced_as_it_was_recorded(run: Run) -> None:
    whole = b"".join(stretch(run, 1.0, 2.0))
    (size,) = struct.unpack_from("<I", whole)
    facts = json.loads(whole[4 : 4 + size])
    joints = len(run.skeleton)
    assert facts["joints"] == list(run.skeleton.names)
    assert facts["start_s"] == pytest.approx(1.0, abs=0.02)
    assert facts["every_s"] == pytest.approx(0.02 * EVERY)
    length = 16 + 32 * joints
    frames = [whole[at : at + length] for at in range(4 + size, len(whole), length)]
    assert len(frames) == 50 and len(frames[-1]) == length
    tick, _, count = struct.unpack_from("<dII", frames[7])
    assert count == joints
    (row,) = run.ticks[run.ticks["tick"] == tick]
    positions, world = run.skeleton.forward_kinematics(row["pose"][0], row["root"][0])
    numbers = np.frombuffer(frames[7], "<f4", offset=16)
    np.testing.assert_allclose(numbers[: 4 * joints].reshape(-1, 4), world, atol=1e-6)
    np.testing.assert_allclose(numbers[4 * joints : 7 * joints].reshape(-1, 3), positions, atol=1e-6)
    holds = numbers[7 * joints :]
    assert holds[run.skeleton.index(run.header["hands"][0]["joint"])] == pytest.approx(row["weights"][0])


def test_after_the_end_nothing_was_danced(run: Run) -> None:
    with pytest.raises(JournalError, match="Nothing was danced at second 100"):
        list(stretch(run, 100.0, 5.0))


def test_the_command_shows_it_by_minutes(bunraku: Command, tmp_path: Path) -> None:
    night = Night(write_show(tmp_path / "show"), tmp_path / "runtime")
    night.dance(60)
    journal = night.saved(tmp_path / "journal")
    said = bunraku("journal", "timeline", "--journal", journal).out
    assert "1 s" in said and "0.0 min  slowest tick" in said
    (run,) = json.loads(bunraku("journal", "timeline", "--json", "--journal", journal).out)
    assert run["late"] == [0, 0]


def test_a_stretch_of_the_journal_has_the_segments_it_lies_in(tmp_path: Path) -> None:
    """Two starts of the stage, the first in two segments; a stretch of its end is the second of them."""
    show, journal = write_show(tmp_path / "show"), tmp_path / "journal"
    night = Night(show, tmp_path / "first")
    night.dance(SEGMENT_TICKS + 200)
    night.saved(journal)
    later = Night(show, tmp_path / "second", begins_at=5000.0)
    later.dance(60)
    later.saved(journal)
    first = read_journal(journal).runs[0]
    lasts_s = 0.02 * len(first.ticks)
    for start_s, has in ((0.0, 1), (lasts_s - 1.0, 1), (lasts_s - 10.0, 2)):
        out = tmp_path / f"{start_s:.0f}.bunraku"
        page_calls.stretch(str(journal), 1, start_s, 60.0 if start_s else 1.0, str(out))
        (part,) = read_journal(out).runs
        assert len(list(segments_of(out))) == has
        assert part.header["run"] == first.header["run"] and part.keyframes, "it can be danced again"
        assert set(part.tick_numbers) < set(first.tick_numbers) or has == 2
    with pytest.raises(JournalError, match="Nothing was danced at second 1000"):
        export_stretch(journal, tmp_path / "none.bunraku", first, 1000.0, 5.0)
