"""Cues that a rehearsal keeps in a copy of the show: none is lost, whatever the disk does."""

from __future__ import annotations

import errno
import zipfile
from pathlib import Path
from typing import Any

import pytest

from appliance.release import rehearsed
from appliance.release.arrivals import SHOW
from appliance.release.packed_show import pack_show
from appliance.release.rehearsed import keep_cue
from appliance.show.bundle import checksum_problems
from appliance.show.show import load_show
from tests.bundles import write_show


def refuse(*_: object, **__: object) -> Any:
    raise OSError(errno.ENOSPC, "No space left on device")


def full_disk(self: Path, text: str, **_: Any) -> int:
    """As a write to a full disk: the file is cut before it takes nothing."""
    self.write_bytes(b"")
    return int(refuse())


def cues(folder: Path) -> list[str]:
    return [one.name for one in load_show(folder / SHOW).config.cues]


@pytest.mark.parametrize("fails", ["write_text", "write_whole", "write_checksums", "pack_show"])
def test_a_full_disk_takes_no_cue_that_was_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    show, folder = write_show(tmp_path / "show"), tmp_path / "rehearsed"
    keep_cue(show, folder, {"name": "one", "phrase": "main"})
    with monkeypatch.context() as disk, pytest.raises(OSError, match="No space left"):
        disk.setattr(*((Path, fails, full_disk) if fails == "write_text" else (rehearsed, fails, refuse)))
        keep_cue(show, folder, {"name": "two", "phrase": "main"})
    assert cues(folder) == ["one"] and not checksum_problems(folder / SHOW)
    assert "has 2 cues now" in keep_cue(show, folder, {"name": "two", "phrase": "main"})
    assert cues(folder) == ["one", "two"] and not checksum_problems(folder / SHOW)


def test_a_show_that_the_disk_does_not_take_leaves_nothing_of_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    show, kept = write_show(tmp_path / "show"), tmp_path / "kept"
    monkeypatch.setattr(zipfile.ZipFile, "write", refuse)
    with pytest.raises(OSError, match="No space left"):
        pack_show(show, kept / "fleet.zip")
    assert not list(kept.iterdir()), "the disk stays as full as it is"
