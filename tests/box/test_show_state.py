"""The show state in shared memory: the file outlives its writer."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.box.show_state import FILE, ShowStateReader, ShowStateWriter, forget_show_state
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, LIGHTS, LOOK


def test_readers_see_what_was_written_and_the_defaults_before(tmp_path: Path) -> None:
    reader = ShowStateReader(tmp_path)
    assert reader.read() == ShowState()
    writer = ShowStateWriter(tmp_path)
    assert reader.read() == ShowState()
    writer.write(ShowState(panic=True).to(LOOK, "Bütö ink"))
    assert reader.read() == ShowState(panic=True).to(LOOK, "Bütö ink")
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
    show_state = ShowState(True)
    for lever in (LOOK, LIGHTS, CUE, LOOK, LIGHTS):
        show_state = show_state.to(lever, name)
    ShowStateWriter(tmp_path).write(show_state)
    assert ShowStateReader(tmp_path).read() == show_state
