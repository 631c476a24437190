"""Blocks: whole or not at all, whatever has become of the file."""

from __future__ import annotations

import os
import resource
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.box.block import BlockReader, BlockWriter
from appliance.box.ring import Ring

KIND, CAPACITY = "test", 1000
RING = Ring(at=128, slots=2, capacity=CAPACITY)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "block"


@pytest.fixture
def reader(path: Path) -> Iterator[BlockReader]:
    reader = BlockReader(path, KIND, writer="the writer")
    yield reader
    reader.close()


def written(path: Path, *payloads: bytes, fresh: bool = False) -> BlockWriter:
    writer = BlockWriter(path, KIND, CAPACITY, fresh)
    for payload in payloads:
        writer.write(payload)
    return writer


def spoil(path: Path, at: int, with_bytes: bytes) -> None:
    with path.open("r+b") as file:
        file.seek(at)
        file.write(with_bytes)


def test_the_newest_payload_is_read_as_often_as_wanted(path: Path, reader: BlockReader) -> None:
    writer = written(path)
    assert reader.read() is None and reader.complaint == ""
    for payload in (b"one", b"", b"x" * CAPACITY, b"four"):
        writer.write(payload)
        assert reader.read() == reader.read() == payload
    writer.close()
    assert reader.read() == b"four"


def test_a_payload_that_is_too_long_is_refused_and_changes_nothing(path: Path, reader: BlockReader) -> None:
    writer = written(path, b"short")
    with pytest.raises(ValueError, match="1001 bytes do not fit"):
        writer.write(b"x" * (CAPACITY + 1))
    assert reader.read() == b"short"


def test_a_reader_waits_for_a_file_and_outlives_it(path: Path, reader: BlockReader) -> None:
    assert reader.read() is None
    writer = written(path, b"there")
    assert reader.read() == b"there"
    path.unlink()
    assert reader.read() == b"there"
    writer.write(b"still there")
    assert reader.read() == b"still there"
    writer.close()
    written(path, b"again").close()
    assert reader.read() == b"again"


def test_a_writer_that_comes_back_goes_on_in_the_same_file(path: Path, reader: BlockReader) -> None:
    for turn in (b"1", b"2", b"3"):
        before = path.stat().st_ino if path.exists() else None
        written(path).close()
        assert before in (None, path.stat().st_ino)
        assert reader.read() == (None if turn == b"1" else b"%d" % (int(turn) - 1))
        written(path, turn).close()
        assert reader.read() == turn


def test_a_fresh_one_starts_with_nothing(path: Path, reader: BlockReader) -> None:
    written(path, b"before").close()
    assert reader.read() == b"before"
    written(path, fresh=True).close()
    assert reader.read() is None


def test_only_one_process_writes(path: Path) -> None:
    writer = written(path, b"mine")
    with pytest.raises(BlockingIOError):
        BlockWriter(path, KIND, CAPACITY)
    writer.close()
    BlockWriter(path, KIND, CAPACITY).close()


@pytest.mark.parametrize(
    "place", [0, 8, 16 + 5, 16 + CAPACITY // 2, RING.slot_bytes - 1], ids=lambda place: f"byte {place}"
)
def test_a_torn_slot_is_refused_and_the_one_before_it_is_read(
    path: Path, reader: BlockReader, place: int
) -> None:
    written(path, b"a" * CAPACITY, b"b" * CAPACITY).close()
    assert reader.read() == b"b" * CAPACITY
    spoil(path, RING.slot_at(2) + place, b"\xff")
    assert reader.read() == b"a" * CAPACITY


def test_a_slot_with_new_ends_and_an_old_middle_is_refused(path: Path, reader: BlockReader) -> None:
    """As a reader could see it where stores arrive in another order than they were made."""
    written(path, b"a" * CAPACITY, b"b" * CAPACITY, b"c" * CAPACITY).close()
    whole = path.read_bytes()
    new = whole[RING.slot_at(3) : RING.slot_at(3) + RING.slot_bytes]
    torn = new[:16] + b"c" * 300 + b"a" * 400 + b"c" * 300 + new[16 + CAPACITY :]
    spoil(path, RING.slot_at(3), torn)
    assert reader.read() == b"b" * CAPACITY


def test_a_writer_killed_before_it_published_leaves_the_one_before(path: Path, reader: BlockReader) -> None:
    written(path, b"first", b"second").close()
    spoil(path, RING.slot_at(3), b"half a slot")
    assert reader.read() == b"second"
    written(path, b"third").close()
    assert reader.read() == b"third"


def test_a_newest_number_that_is_nonsense_is_not_followed(path: Path, reader: BlockReader) -> None:
    written(path, b"first", b"second").close()
    spoil(path, RING.at, b"\xff" * 8)
    assert reader.read() is None
    written(path, b"anew").close()
    assert reader.read() == b"anew"


@pytest.mark.parametrize("length", [0, 1, 100, RING.at, RING.slot_at(2) + 7, RING.end - 1])
def test_a_file_that_is_cut_short_is_never_followed_into_nothing(
    path: Path, reader: BlockReader, length: int
) -> None:
    written(path, b"one", b"two").close()
    assert reader.read() == b"two"
    os.truncate(path, length)
    assert reader.read() in (None, b"one", b"two")
    late = BlockReader(path, KIND, writer="the writer")
    assert late.read() in (None, b"one", b"two")
    assert length >= 100 or "cut short. Start the writer again." in late.complaint
    written(path, b"three").close()
    assert reader.read() == late.read() == b"three"
    late.close()


@pytest.mark.parametrize("content", [b"x" * 5000, b"\0" * 5000, b"bunraku\n" + b"y" * 5000])
def test_a_foreign_file_is_named_and_replaced_by_the_next_writer(
    path: Path, reader: BlockReader, content: bytes
) -> None:
    path.write_bytes(content)
    assert reader.read() is None
    assert "was not written by the writer. Remove it." in reader.complaint
    written(path, b"ours").close()
    assert reader.read() == b"ours" and reader.complaint == ""


def test_another_kind_is_foreign(path: Path) -> None:
    written(path, b"a test").close()
    assert BlockReader(path, "show_state").read() is None


def test_a_damaged_header_is_refused(path: Path, reader: BlockReader) -> None:
    written(path, b"one").close()
    spoil(path, 32, struct.pack("<I", 1 << 30))
    assert reader.read() is None
    assert "is damaged. Start the writer again." in reader.complaint


@pytest.mark.parametrize(("theirs", "who"), [(3, "this program"), (1, "the writer")])
def test_another_format_says_which_side_to_update(path: Path, theirs: int, who: str) -> None:
    BlockWriter(path, KIND, CAPACITY, version=theirs).close()
    reader = BlockReader(path, KIND, 2, "the writer")
    assert reader.read() is None
    assert f"has format {theirs}, and this program reads format 2. Update {who}" in reader.complaint
    BlockWriter(path, KIND, CAPACITY, version=2).write(b"updated")
    assert reader.read() == b"updated"


def test_folders_pipes_and_links_in_the_place_of_the_file_do_no_harm(path: Path, reader: BlockReader) -> None:
    path.mkdir()
    assert reader.read() is None and "cannot be read" in reader.complaint
    path.rmdir()
    os.mkfifo(path)
    assert reader.read() is None and "cannot be read" in reader.complaint
    path.unlink()
    written(path.with_name("other"), b"elsewhere").close()
    path.symlink_to(path.with_name("other"))
    assert reader.read() is None and "cannot be read" in reader.complaint


def test_a_folder_without_room_is_an_os_error_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(OSError):
        BlockWriter(tmp_path / "missing" / "block", KIND, CAPACITY)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(OSError):
            BlockWriter(tmp_path / "block", KIND, CAPACITY)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []
