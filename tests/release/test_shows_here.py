"""The shows that a box can play, as the page lists them to begin a learning with."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from appliance.release.choice import CHOSEN, Choice, ShowAndBox
from appliance.release.shows_here import shows_here
from appliance.show.bundle import CHECKSUMS, bundled_shows, default_show_path

BUNDLED = list(bundled_shows())


def show(folder: Path, name: str, since: float, checksums: str = "") -> Path:
    folder.mkdir(parents=True)
    (folder / "show.yaml").write_text(f"name: {name}\n")
    os.utime(folder / "show.yaml", (since, since))
    if checksums:
        (folder / CHECKSUMS).write_text(checksums)
    return folder


def test_the_newest_comes_first_and_those_of_the_box_last(tmp_path: Path) -> None:
    data, run = tmp_path / "data", tmp_path / "run"
    old = show(data / "shows" / "a", "Old", 100.0, "old")
    waits = show(data / "shows" / "b", "Waits", 300.0, "waits")
    learned = show(tmp_path / "learning" / "show", "Learned", 200.0, "learned")
    gone = ShowAndBox(tmp_path / "gone", id="c+")
    for folder, pairs in (
        (data, (ShowAndBox(waits, id="b+"), ShowAndBox(old, id="a+"))),
        (run, (ShowAndBox(old, id="a+"), gone)),
    ):
        folder.mkdir(exist_ok=True)
        Choice(pairs, data=data).write(folder / CHOSEN)
    found = shows_here(run / CHOSEN, old, learned)
    assert [one["name"] for one in found] == ["Waits", "Learned", "Old", *BUNDLED]
    assert [one["id"] for one in found] == [str(waits), str(learned), str(old), *BUNDLED]
    assert [one["since"] for one in found] == [300.0, 200.0, 100.0, *(None for _ in BUNDLED)]
    assert [one["name"] for one in found if one["danced"]] == ["Old"]
    json.dumps(found)


def test_a_show_with_the_same_files_is_listed_once_as_the_one_on_stage(tmp_path: Path) -> None:
    learned = show(tmp_path / "learning" / "show", "Mine", 200.0, "same")
    adopted = show(tmp_path / "shows" / "a", "Mine", 100.0, "same")
    (mine, *others) = shows_here(None, adopted, learned)
    assert (mine["id"], mine["danced"]) == (str(adopted), True)
    assert [one["name"] for one in others] == BUNDLED


def test_a_bundled_show_on_the_stage_is_listed_once(tmp_path: Path) -> None:
    found = shows_here(None, default_show_path(), None)
    assert [(one["id"], one["danced"]) for one in found] == [(name, name == "default") for name in BUNDLED]


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b"name:", b"\xff", b"title: x", b"a: &a [*a]"])
def test_what_is_no_show_is_not_listed(text: bytes, tmp_path: Path) -> None:
    folder = show(tmp_path / "torn", "x", 1.0)
    (folder / "show.yaml").write_bytes(text)
    assert [one["id"] for one in shows_here(tmp_path / CHOSEN, folder, tmp_path / "none")] == BUNDLED
