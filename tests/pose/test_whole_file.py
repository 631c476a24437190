"""A file is whole or as it was, whatever ends its writing."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from appliance.pose.whole_file import write_text_whole, written_whole


@pytest.mark.parametrize("error", [OSError("disk full"), ValueError("no"), KeyboardInterrupt()])
def test_what_was_there_stays_until_all_is_written(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "partner.onnx"
    path.write_bytes(b"before")
    (tmp_path / ".partner.part.onnx").write_bytes(b"left by a process that was killed")
    with pytest.raises(type(error)), written_whole(path) as part:
        assert part.suffix == ".onnx", "libraries choose the format by it"
        part.write_bytes(b"half of")
        raise error
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"before"]


def test_a_new_content_is_on_the_disk_before_it_has_the_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []
    monkeypatch.setattr(os, "fsync", lambda _: steps.append("synced"))
    replace = Path.replace
    monkeypatch.setattr(Path, "replace", lambda file, to: steps.append("renamed") or replace(file, to))
    write_text_whole(tmp_path / "report.json", "左\n")
    assert steps == ["synced", "renamed", "synced"], "the content, and then the name"
    assert (tmp_path / "report.json").read_bytes() == "左\n".encode()
    assert len(list(tmp_path.iterdir())) == 1
