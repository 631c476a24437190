"""The show state: fades are functions of the moment; the file outlives whoever wrote it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from appliance.box.block import BlockWriter
from appliance.box.show_state import (
    FILE,
    KIND,
    LARGEST,
    ShowState,
    ShowStateReader,
    ShowStateWriter,
    forget_show_state,
)

NOW = 1000.0


def test_by_itself_the_show_runs_in_full_light() -> None:
    show_state = ShowState()
    assert show_state.level(NOW) == 1.0
    assert not show_state.is_safe(NOW)
    assert show_state.look_mix(NOW) == show_state.lights_mix(NOW) == 1.0


def test_panic_is_black_and_safe_at_once_and_blackout_is_black_alone() -> None:
    panic, blackout = ShowState(panic=True), ShowState(blackout=True)
    assert (panic.level(NOW), panic.is_safe(NOW)) == (0.0, True)
    assert (blackout.level(NOW), blackout.is_safe(NOW)) == (0.0, False)


def test_a_stop_fades_and_is_safe_when_it_is_dark() -> None:
    show_state = ShowState().with_going(False, NOW, 2.0)
    assert [show_state.level(NOW + t) for t in (0.0, 0.5, 1.0, 2.0, 9.0)] == [1.0, 0.75, 0.5, 0.0, 0.0]
    assert [show_state.is_safe(NOW + t) for t in (0.0, 1.9, 2.0)] == [False, False, True]


def test_going_on_in_the_middle_of_a_stop_begins_at_its_brightness() -> None:
    stopping = ShowState().with_going(False, NOW, 2.0)
    show_state = stopping.with_going(True, NOW + 1.0, 4.0)
    assert show_state.level(NOW + 1.0) == pytest.approx(stopping.level(NOW + 1.0)) == 0.5
    assert show_state.level(NOW + 2.0) == pytest.approx(0.75)
    assert show_state.level(NOW + 3.0) == 1.0


def test_the_master_fades_from_where_it_is() -> None:
    show_state = ShowState().with_master(0.0, NOW, 10.0)
    assert show_state.level(NOW + 4.0) == pytest.approx(0.6)
    show_state = show_state.with_master(1.0, NOW + 4.0, 2.0)
    assert show_state.level(NOW + 4.0) == pytest.approx(0.6)
    assert show_state.level(NOW + 5.0) == pytest.approx(0.8)
    assert show_state.with_master(0.3, NOW + 5.0, 0.0).level(NOW + 5.0) == 0.3


def test_a_look_that_is_left_before_it_was_there_is_left_from_what_is_seen_most() -> None:
    show_state = ShowState().with_look("ink", NOW, 2.0)
    assert (show_state.look_before, show_state.look, show_state.look_mix(NOW + 0.5)) == ("", "ink", 0.25)
    assert show_state.with_look("lines", NOW + 0.5, 2.0).look_before == ""
    assert show_state.with_look("lines", NOW + 1.5, 2.0).look_before == "ink"
    carded = ShowState().with_card("title", NOW, 2.0)
    assert carded.card_mix(NOW + 0.5) == 0.25
    assert carded.with_card("", NOW + 1.5, 2.0).card_before == "title"
    turned = ShowState().with_camera({"angle_deg": 90.0}, NOW, 2.0)
    assert turned.with_camera({}, NOW + 1.5, 2.0).camera_before == {"angle_deg": 90.0}
    assert turned.for_show("another").camera == {} and turned.camera_mix(NOW + 1.0) == 0.5
    lit = ShowState().with_lights("cold", NOW, 2.0)
    assert lit.with_lights("warm", NOW + 1.5, 2.0).lights_before == "cold"


def test_what_began_in_the_future_is_over() -> None:
    """The monotonic clock starts anew with the machine; a folder on a disk may outlive that."""
    show_state = replace(
        ShowState().with_going(False, NOW, 2.0), master=0.4, master_since=NOW, master_fade_s=5.0
    )
    settled = show_state.settled(3.0)
    assert settled.is_safe(3.0)
    assert settled.master_level(3.0) == 0.4
    assert show_state.settled(NOW + 1.0) == show_state


def test_readers_see_what_was_written_and_the_defaults_before(tmp_path: Path) -> None:
    reader = ShowStateReader(tmp_path)
    assert reader.read() == ShowState()
    writer = ShowStateWriter(tmp_path)
    assert reader.read() == ShowState()
    writer.write(ShowState(panic=True, look="Bütö ink"))
    assert reader.read() == ShowState(panic=True, look="Bütö ink")
    assert reader.read() is reader.read()
    writer.close()
    reader.close()


def test_it_outlives_its_writer_and_the_next_one_goes_on_with_the_file(tmp_path: Path) -> None:
    first, reader = ShowStateWriter(tmp_path), ShowStateReader(tmp_path)
    first.write(ShowState(panic=True))
    first.close()
    assert reader.read().panic
    second = ShowStateWriter(tmp_path)
    assert reader.read().panic
    second.write(ShowState())
    assert not reader.read().panic
    second.close()


def test_only_one_writes_at_a_time(tmp_path: Path) -> None:
    first = ShowStateWriter(tmp_path)
    with pytest.raises(BlockingIOError):
        ShowStateWriter(tmp_path)
    first.close()
    ShowStateWriter(tmp_path).close()


def test_a_forgotten_house_is_the_default_for_a_new_reader(tmp_path: Path) -> None:
    writer, reader = ShowStateWriter(tmp_path), ShowStateReader(tmp_path)
    writer.write(ShowState(blackout=True))
    assert reader.read().blackout
    writer.close()
    forget_show_state(tmp_path)
    assert ShowStateReader(tmp_path).read() == ShowState()
    assert reader.read().blackout  # the last frames are not seen to flash up
    forget_show_state(tmp_path)
    ShowStateWriter(tmp_path).write(ShowState())
    assert reader.read() == ShowState()


def test_panic_works_in_a_folder_that_somebody_emptied(tmp_path: Path) -> None:
    """As happens to the folder of a user who logs out while the show runs."""
    writer, reader = ShowStateWriter(tmp_path), ShowStateReader(tmp_path)
    writer.write(ShowState())
    assert not reader.read().panic
    (tmp_path / FILE).unlink()
    writer.write(ShowState(panic=True))
    assert reader.read().panic


def test_a_new_file_lifts_no_panic_before_anything_is_written_in_it(tmp_path: Path) -> None:
    """Whoever made it may be stopped right then."""
    reader = ShowStateReader(tmp_path)
    ShowStateWriter(tmp_path).write(ShowState(panic=True))
    assert reader.read().panic
    (tmp_path / FILE).unlink()
    writer = ShowStateWriter(tmp_path)
    assert reader.read().panic
    writer.write(ShowState())
    assert not reader.read().panic


def test_the_longest_names_of_a_show_fit(tmp_path: Path) -> None:
    name = "\N{PERFORMING ARTS}" * 64
    show_state = ShowState(True, look=name, look_before=name, lights=name, lights_before=name, cue=name)
    ShowStateWriter(tmp_path).write(show_state)
    assert ShowStateReader(tmp_path).read() == show_state


@pytest.mark.parametrize(
    ("payload", "read"),
    [
        (b'{"panic": true, "mood": "dark"}', ShowState(panic=True)),
        (b"not json", ShowState()),
        (b"[1]", ShowState()),
        (b"", ShowState()),
    ],
)
def test_of_another_version_what_both_know_counts(tmp_path: Path, payload: bytes, read: ShowState) -> None:
    writer = BlockWriter(tmp_path / FILE, KIND, LARGEST)
    writer.write(payload)
    assert ShowStateReader(tmp_path).read() == read
    writer.close()
