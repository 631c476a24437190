"""Files that are whole or not there: every error leaves what was there, and nothing beside it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from appliance.box.durable import (
    beside,
    new_file,
    private_folder,
    put_in_place,
    replacing,
    write_beside,
    write_whole,
)


def test_a_file_is_replaced_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for content in (b"one", b"two" * 100_000, b""):
        beside(tmp_path / "file").write_bytes(b"left by a process that was killed")
        write_whole(path, content)
        assert path.read_bytes() == content
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("private", [False, True])
def test_a_private_file_is_its_owners_alone(tmp_path: Path, private: bool) -> None:
    before = os.umask(0)
    try:
        write_whole(tmp_path / "file", b"content", private)
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == (0o600 if private else 0o666)


def test_a_file_that_a_power_cut_left_beside_is_none_of_its_kind(tmp_path: Path) -> None:
    """A folder of motions is searched for *.material: half a motion is not to be called."""
    write_beside(tmp_path / "anna.material", b"half of it")
    assert list(tmp_path.iterdir()) == [beside(tmp_path / "anna.material")]
    assert not list(tmp_path.glob("*.material"))


def test_the_folders_above_a_private_one_are_private_too(tmp_path: Path) -> None:
    """Else a process that outlives its box makes a runtime folder that no box accepts after it."""
    before = os.umask(0)
    try:
        private_folder(tmp_path / "runtime/made/one")
        private_folder(tmp_path / "runtime/made")  # one that is there stays as it is
    finally:
        os.umask(before)
    for name in ("runtime", "runtime/made", "runtime/made/one"):
        assert (tmp_path / name).stat().st_mode & 0o777 == 0o700, name
    (tmp_path / "file").touch()
    for inside in ("file", "file/one"):
        with pytest.raises(OSError):
            private_folder(tmp_path / inside)


def test_an_error_on_the_way_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"before")
    with pytest.raises(ValueError, match="halfway"), replacing(path) as stream:
        stream.write(b"half of it")
        raise ValueError("halfway")
    with pytest.raises(FileExistsError), new_file(path):
        pass
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError):
        put_in_place(write_beside(tmp_path / "folder", b"content"), tmp_path / "folder")
    assert path.read_bytes() == b"before"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["file", "folder"]
