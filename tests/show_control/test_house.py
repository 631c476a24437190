"""The house: fades are functions of the moment; the file outlives whoever wrote it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from appliance.box.block import BlockWriter
from appliance.box.show_state import FILE, KIND, LARGEST, House, HouseReader, HouseWriter, forget_house

NOW = 1000.0


def test_by_itself_the_show_runs_in_full_light() -> None:
    house = House()
    assert house.level(NOW) == 1.0
    assert not house.is_safe(NOW)
    assert house.look_mix(NOW) == house.lights_mix(NOW) == 1.0


def test_panic_is_black_and_safe_at_once_and_blackout_is_black_alone() -> None:
    panic, blackout = House(panic=True), House(blackout=True)
    assert (panic.level(NOW), panic.is_safe(NOW)) == (0.0, True)
    assert (blackout.level(NOW), blackout.is_safe(NOW)) == (0.0, False)


def test_a_stop_fades_and_is_safe_when_it_is_dark() -> None:
    house = House().with_going(False, NOW, 2.0)
    assert [house.level(NOW + t) for t in (0.0, 0.5, 1.0, 2.0, 9.0)] == [1.0, 0.75, 0.5, 0.0, 0.0]
    assert [house.is_safe(NOW + t) for t in (0.0, 1.9, 2.0)] == [False, False, True]


def test_going_on_in_the_middle_of_a_stop_begins_at_its_brightness() -> None:
    stopping = House().with_going(False, NOW, 2.0)
    house = stopping.with_going(True, NOW + 1.0, 4.0)
    assert house.level(NOW + 1.0) == pytest.approx(stopping.level(NOW + 1.0)) == 0.5
    assert house.level(NOW + 2.0) == pytest.approx(0.75)
    assert house.level(NOW + 3.0) == 1.0


def test_the_master_fades_from_where_it_is() -> None:
    house = House().with_master(0.0, NOW, 10.0)
    assert house.level(NOW + 4.0) == pytest.approx(0.6)
    house = house.with_master(1.0, NOW + 4.0, 2.0)
    assert house.level(NOW + 4.0) == pytest.approx(0.6)
    assert house.level(NOW + 5.0) == pytest.approx(0.8)
    assert house.with_master(0.3, NOW + 5.0, 0.0).level(NOW + 5.0) == 0.3


def test_a_look_that_is_left_before_it_was_there_is_left_from_what_is_seen_most() -> None:
    house = House().with_look("ink", NOW, 2.0)
    assert (house.look_before, house.look, house.look_mix(NOW + 0.5)) == ("", "ink", 0.25)
    assert house.with_look("lines", NOW + 0.5, 2.0).look_before == ""
    assert house.with_look("lines", NOW + 1.5, 2.0).look_before == "ink"
    lit = House().with_lights("cold", NOW, 2.0)
    assert lit.with_lights("warm", NOW + 1.5, 2.0).lights_before == "cold"


def test_what_began_in_the_future_is_over() -> None:
    """The monotonic clock starts anew with the machine; a folder on a disk may outlive that."""
    house = replace(House().with_going(False, NOW, 2.0), master=0.4, master_since=NOW, master_fade_s=5.0)
    settled = house.settled(3.0)
    assert settled.is_safe(3.0)
    assert settled.master_level(3.0) == 0.4
    assert house.settled(NOW + 1.0) == house


def test_readers_see_what_was_written_and_the_defaults_before(tmp_path: Path) -> None:
    reader = HouseReader(tmp_path)
    assert reader.read() == House()
    writer = HouseWriter(tmp_path)
    assert reader.read() == House()
    writer.write(House(panic=True, look="Bütö ink"))
    assert reader.read() == House(panic=True, look="Bütö ink")
    assert reader.read() is reader.read()
    writer.close()
    reader.close()


def test_it_outlives_its_writer_and_the_next_one_goes_on_with_the_file(tmp_path: Path) -> None:
    first, reader = HouseWriter(tmp_path), HouseReader(tmp_path)
    first.write(House(panic=True))
    first.close()
    assert reader.read().panic
    second = HouseWriter(tmp_path)
    assert reader.read().panic
    second.write(House())
    assert not reader.read().panic
    second.close()


def test_only_one_writes_at_a_time(tmp_path: Path) -> None:
    first = HouseWriter(tmp_path)
    with pytest.raises(BlockingIOError):
        HouseWriter(tmp_path)
    first.close()
    HouseWriter(tmp_path).close()


def test_a_forgotten_house_is_the_default_for_a_new_reader(tmp_path: Path) -> None:
    writer, reader = HouseWriter(tmp_path), HouseReader(tmp_path)
    writer.write(House(blackout=True))
    assert reader.read().blackout
    writer.close()
    forget_house(tmp_path)
    assert HouseReader(tmp_path).read() == House()
    assert reader.read().blackout  # the last frames are not seen to flash up
    forget_house(tmp_path)
    HouseWriter(tmp_path).write(House())
    assert reader.read() == House()


def test_panic_works_in_a_folder_that_somebody_emptied(tmp_path: Path) -> None:
    """As happens to the folder of a user who logs out while the show runs."""
    writer, reader = HouseWriter(tmp_path), HouseReader(tmp_path)
    writer.write(House())
    assert not reader.read().panic
    (tmp_path / FILE).unlink()
    writer.write(House(panic=True))
    assert reader.read().panic


def test_a_new_file_lifts_no_panic_before_anything_is_written_in_it(tmp_path: Path) -> None:
    """Whoever made it may be stopped right then."""
    reader = HouseReader(tmp_path)
    HouseWriter(tmp_path).write(House(panic=True))
    assert reader.read().panic
    (tmp_path / FILE).unlink()
    writer = HouseWriter(tmp_path)
    assert reader.read().panic
    writer.write(House())
    assert not reader.read().panic


def test_the_longest_names_of_a_show_fit(tmp_path: Path) -> None:
    name = "\N{PERFORMING ARTS}" * 64
    house = House(True, look=name, look_before=name, lights=name, lights_before=name, cue=name)
    HouseWriter(tmp_path).write(house)
    assert HouseReader(tmp_path).read() == house


@pytest.mark.parametrize(
    ("payload", "read"),
    [
        (b'{"panic": true, "mood": "dark"}', House(panic=True)),
        (b"not json", House()),
        (b"[1]", House()),
        (b"", House()),
    ],
)
def test_of_another_version_what_both_know_counts(tmp_path: Path, payload: bytes, read: House) -> None:
    writer = BlockWriter(tmp_path / FILE, KIND, LARGEST)
    writer.write(payload)
    assert HouseReader(tmp_path).read() == read
    writer.close()
