"""Archives that claim more than any journal holds are refused."""

from __future__ import annotations

import tarfile
from pathlib import Path

import pytest

from appliance.recorder.journal_error import JournalError
from appliance.recorder.reading import read_journal
from tests.recorder.odd_journals import listed_in_bounds


def test_an_archive_of_very_many_parts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.bunraku"
    path.write_bytes(b"".join(tarfile.TarInfo(f"{n}.segment").tobuf() for n in range(25_000)) + bytes(1024))
    assert "larger than any journal" in listed_in_bounds(path)


def test_an_archive_whose_names_are_enormous_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.bunraku"
    name = tarfile.TarInfo("././@LongLink")
    name.type, name.size = tarfile.GNUTYPE_LONGNAME, 1 << 36
    path.write_bytes(name.tobuf(tarfile.GNU_FORMAT))
    with path.open("r+b") as file:
        file.truncate(1 << 37)
    assert "larger than any journal" in listed_in_bounds(path)


def test_a_part_that_claims_to_be_enormous_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.bunraku"
    member = tarfile.TarInfo("1.segment")
    member.size = 1 << 40
    path.write_bytes(member.tobuf() + bytes(10240))
    with path.open("r+b") as file:
        file.truncate((1 << 40) + 10240)  # as long as it claims, and no room taken
    with pytest.raises(JournalError, match="larger than any journal"):
        read_journal(path)
