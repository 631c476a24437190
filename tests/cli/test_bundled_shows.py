"""A show that comes with the box is named on the command line as a folder is, and dances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.dancer.material import map_reach
from appliance.recorder.reading import read_journal
from appliance.show.bundle import bundled_shows
from appliance.show.show import load_show
from hw_sim.bundled_shows import show_folder
from tests.cli.test_cli import write_box
from tests.command import Command

SHOWS = bundled_shows()


@pytest.mark.parametrize("given", [("martial",), ("--show", "martial")])
def test_check_takes_its_name(bunraku: Command, tmp_path: Path, given: tuple[str, ...]) -> None:
    output = bunraku("check", *given, "--box", write_box(tmp_path)).out
    assert f"{load_show(SHOWS['martial']).config.name}: the bundle is whole." in output


def test_check_says_that_a_map_leads_nowhere(
    bunraku: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = write_box(tmp_path)
    assert "map is dead" not in bunraku("check", "--box", box).out
    monkeypatch.setattr(map_reach, "DEAD", 100.0)  # of what its poses differ by: no map leads so far
    assert "pose.onnx: The map is dead: from corner to corner" in bunraku("check", "--box", box).out


def test_check_takes_one_show(bunraku: Command) -> None:
    assert "name one show" in bunraku("check", "martial", "--show", "default", status=2).err


@pytest.mark.parametrize("name", SHOWS)
def test_it_dances_and_its_journal_knows_it(
    bunraku: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    box, journal = write_box(tmp_path), tmp_path / "dance"
    bunraku("play", "--show", name, "--box", box, "--seconds", 1, "--alone", "--journal", journal)
    danced = read_journal(journal)
    assert danced.header["show"] == load_show(SHOWS[name]).config.name
    assert len(danced.ticks) > 20
    assert np.ptp(danced.ticks["pose"], axis=0).max() > 0.01
    assert "All are the same, bit for bit." in bunraku("replay", journal).out


def test_a_misspelt_name_is_refused_with_the_nearest(bunraku: Command) -> None:
    assert "Did you mean 'martial'" in bunraku("play", "--show", "marital", status=2).err


def test_the_simulation_finds_it_without_the_box_s_modules(tmp_path: Path) -> None:
    assert {name: show_folder(Path(name)) for name in SHOWS} == SHOWS
    assert show_folder(None) == SHOWS["default"]
    assert show_folder(tmp_path) == tmp_path
