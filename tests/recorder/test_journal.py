"""The flight recorder: what the stage notes reaches the disk, and is read back from whatever is left."""

from __future__ import annotations

import os
import resource
import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.box.clock import TICK_S
from appliance.recorder import chunks
from appliance.recorder.export import export
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import read_journal
from appliance.recorder.log import Entry, Pieces, pieces_of
from appliance.recorder.record import PIECE
from appliance.recorder.segments import segment_paths
from appliance.stage.recorder import EVENT_BYTES, FILE, LOG_SLOTS, LONGEST_EVENT
from tests.bundles import FIGURE, WORN, write_show
from tests.recorder.night import Night, reading

TURNED = (0.8, 0.6, 0.0, 0.0)


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_show(tmp_path_factory.mktemp("bundle") / "show")


@pytest.fixture
def night(show: Path, tmp_path: Path) -> Night:
    return Night(show, tmp_path / "runtime")


def test_every_tick_the_readings_and_the_figure_are_read_back(night: Night, tmp_path: Path) -> None:
    night.dance(70, reading(TURNED))
    night.dance(30)
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    assert run.ticks["tick"].tolist() == list(range(100))
    np.testing.assert_array_equal(run.ticks["pose"][-1, 0], night.tick.frame.puppets[0].pose)
    np.testing.assert_array_equal(run.ticks["reading_here"][:, 0], [1] * 70 + [0] * 30)
    np.testing.assert_array_equal(run.ticks["reading_orientation"][69, 0], TURNED)
    assert run.header["hands"] == [WORN | {"puppet": 0, "kind": "sensor", "by": "orientation"}]
    assert run.skeleton.same_joints(FIGURE) and run.skeleton.ends == FIGURE.ends
    np.testing.assert_allclose(run.skeleton.offsets, FIGURE.offsets)


def test_events_are_kept_in_their_place_and_the_longest_lose_their_end(night: Night, tmp_path: Path) -> None:
    night.dance(3)
    night.recorder.event("said", 12.5, message="x" * 5 * LONGEST_EVENT, count=3)
    night.dance(2)
    night.recorder.event("odd", 13.0, what=object())
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    ((number, event),) = run.events
    assert (event["kind"], event["now"], event["count"]) == ("said", 12.5, 3)
    assert LONGEST_EVENT / 3 < len(event["message"]) < LONGEST_EVENT
    assert run.tick_numbers.tolist() == [1, 2, 3, number + 1, number + 2]
    assert night.recorder.lost == 1


def test_a_long_event_is_whole(night: Night, tmp_path: Path) -> None:
    recipe = "".join(chr(97 + place % 26) for place in range(4 * EVENT_BYTES))
    night.dance(2)
    night.recorder.event("order", 12.5, order={"text": recipe})
    night.dance(1)
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    ((number, event),) = run.events
    assert event["order"]["text"] == recipe
    assert run.tick_numbers.tolist() == [1, 2, number + 1]


def test_an_event_that_lost_a_piece_is_left_out_and_the_next_one_is_whole() -> None:
    text = bytes(range(256)) * 10
    entries = [Entry(7 + place, PIECE, data) for place, data in enumerate(pieces_of(text, EVENT_BYTES))]
    later = [replace(entry, number=entry.number + 40) for entry in entries]
    pieces = Pieces()
    found = [pieces.whole(entry) for entry in (entries[0], *entries[2:], *later)]
    assert found == [None] * (len(found) - 1) + [text]


def test_what_a_keeper_missed_is_fetched_by_the_next_one_and_nothing_comes_twice(
    night: Night, tmp_path: Path
) -> None:
    for count in (40, 700, 1):
        night.dance(count)
        night.saved(tmp_path / "journal")
    (run,) = read_journal(tmp_path / "journal").runs
    assert run.ticks["tick"].tolist() == list(range(741))
    assert len(run.keyframes) == 2
    assert len(segment_paths(tmp_path / "journal")) == 3


def test_the_memory_holds_more_than_a_minute_and_what_is_older_is_a_gap(night: Night, tmp_path: Path) -> None:
    night.dance(10)
    night.saved(tmp_path / "journal")
    night.dance(LOG_SLOTS + 20)
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    assert LOG_SLOTS * TICK_S > 60.0
    assert run.ticks["tick"].tolist() == [*range(10), *range(30, LOG_SLOTS + 30)]


def test_a_stage_that_died_leaves_all_that_it_noted(show: Path, tmp_path: Path) -> None:
    """The keeper has the memory of the old one still open when the new one has put its own in its place."""
    first = Night(show, tmp_path / "runtime")
    mirror = first.mirror(tmp_path / "journal")
    first.dance(20)
    mirror.turn(0.0)
    first.dance(15)
    second = Night(show, tmp_path / "runtime")
    second.dance(5)
    mirror.turn(1.0)
    runs = read_journal(tmp_path / "journal").runs
    assert [run.ticks["tick"].tolist() for run in runs] == [list(range(35)), list(range(5))]


def test_segments_are_a_minute_long_and_the_oldest_go(night: Night, tmp_path: Path) -> None:
    mirror, folder = night.mirror(tmp_path / "journal", minutes=1.0), tmp_path / "journal"
    for second in range(190):
        night.dance(50)
        mirror.turn(float(second))
    first, last = (np.int64(tick) for tick in read_journal(folder).ticks["tick"][[0, -1]])
    assert last == 190 * 50 - 1
    assert 60 * 50 <= last - first <= 120 * 50
    assert 2 <= len(segment_paths(folder)) <= 3
    oldest = read_journal(segment_paths(folder)[0]).runs[0]
    assert oldest.keyframes[0][0] < oldest.tick_numbers[0]  # a replay may begin with its first tick


def test_a_torn_end_costs_that_piece_alone(night: Night, tmp_path: Path) -> None:
    mirror, folder = night.mirror(tmp_path / "journal"), tmp_path / "journal"
    for second in range(4):
        night.dance(25)
        mirror.turn(float(second))
    (segment,) = segment_paths(folder)
    whole = segment.read_bytes()
    seen = set()
    for size in range(0, len(whole), 97):
        segment.write_bytes(whole[:size])
        try:
            ticks = read_journal(folder).ticks["tick"].tolist()
        except JournalError as error:
            assert "nothing was recorded" in str(error) or "not a journal" in str(error)
            ticks = []
        assert ticks == list(range(len(ticks)))
        seen.add(len(ticks))
    assert seen == {0, 25, 50, 75}  # the last byte of the fourth piece was never there
    damaged = bytearray(whole)
    damaged[len(whole) - 40] ^= 1
    segment.write_bytes(damaged)
    assert len(read_journal(folder).ticks) == 75


def test_an_export_is_one_file_that_reads_as_the_folder_does(night: Night, tmp_path: Path) -> None:
    night.dance(120, reading(TURNED))
    folder = night.saved(tmp_path / "journal")
    stick = tmp_path / "stick"
    stick.mkdir()
    exported = export(folder, stick, lambda: 0.0)
    assert exported.name.startswith("a-test-19") and exported.suffix == ".bunraku"
    assert [path.name for path in stick.iterdir()] == [exported.name]
    assert read_journal(exported).ticks.tobytes() == read_journal(folder).ticks.tobytes()
    with tarfile.open(exported) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    assert os.system(f"cd {tmp_path}/unpacked && sha256sum --check --quiet SHA256SUMS") == 0


def test_an_export_that_does_not_fit_leaves_nothing_behind(night: Night, tmp_path: Path) -> None:
    night.dance(10)
    folder = night.saved(tmp_path / "journal")
    with pytest.raises(JournalError, match=r"cannot be written there.*stays on the box"):
        export(folder, tmp_path / "absent" / "night.bunraku")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(JournalError, match="File too large"):
            export(folder, tmp_path / "full")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.glob("*full*"))


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04" * 40000, b"bkj2" + bytes(200)])
def test_what_is_no_journal_is_refused_in_words(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "odd"
    path.write_bytes(content)
    with pytest.raises(JournalError, match=r"not a journal|nothing was recorded"):
        read_journal(path)


def test_a_journal_of_an_older_release_says_so(tmp_path: Path) -> None:
    path = tmp_path / "old.journal"
    path.write_bytes(b"bunraku journal 1\n{}".ljust(70000, b"\0"))
    with pytest.raises(JournalError, match="older release"):
        read_journal(path)


def test_an_absent_and_an_empty_journal_are_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="cannot be read"):
        read_journal(tmp_path / "absent.journal")
    with pytest.raises(JournalError, match="no journal is in this folder"):
        read_journal(tmp_path)


def test_only_its_owner_reads_what_is_in_memory_and_on_the_disk(night: Night, tmp_path: Path) -> None:
    night.dance(5)
    folder = night.saved(tmp_path / "journal")
    for path in (tmp_path / "runtime" / FILE, folder, *segment_paths(folder)):
        assert path.stat().st_mode & 0o077 == 0


def test_silence_costs_little_room(night: Night, tmp_path: Path) -> None:
    night.dance(500)
    (segment,) = segment_paths(night.saved(tmp_path / "journal"))
    raw = sum(len(one.data) for one in chunks.chunks(segment.read_bytes()))
    assert segment.stat().st_size < raw / 2
