"""`bunraku journal`: lists, and exports to a stick that is mounted to be read only."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.cli import journal, pictures
from appliance.pose import quaternion
from appliance.recorder.journal_reader import read_journal
from appliance.release import choice
from appliance.studio.exchange.reading import read_as_given
from tests.bundles import write_show
from tests.command import Command
from tests.recorder.night import Night
from tests.stage.test_puppets import write_puppets


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    night = Night(write_show(tmp_path / "show"), tmp_path / "runtime")
    night.dance(30)
    night.order("rate", 0.5)
    night.recorder.event("said", 1000.5, message="The network gives poses again.")
    night.dance(20, late_s=0.012)
    return night.saved(tmp_path / "journal")


@pytest.fixture
def stick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A file system of its own, mounted as the box mounts a stick."""
    folder = tmp_path / "stick"
    folder.mkdir()
    mounting = ("mount", "-t", "tmpfs", "-o", "ro,size=1m", "tmpfs", str(folder))
    if subprocess.run(mounting, capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here (not root, or in a closed container)")
    monkeypatch.setattr(journal, "STICK", folder)
    yield folder
    subprocess.run(("umount", "-l", str(folder)), check=True)


def test_the_stick_takes_the_journal_and_is_read_only_again(
    recorded: Path, stick: Path, bunraku: Command
) -> None:
    assert "The stick can be pulled." in bunraku("journal", "export", "--journal", recorded).out
    (exported,) = stick.iterdir()
    assert len(read_journal(exported).ticks) == 50
    with pytest.raises(OSError, match="Read-only"):
        (stick / "more").touch()


def test_a_stick_that_is_too_small_keeps_what_was_on_it(
    recorded: Path, stick: Path, bunraku: Command
) -> None:
    subprocess.run(("mount", "-o", "remount,rw,size=8k", str(stick)), check=True)
    assert "No space left on device" in bunraku("journal", "export", "--journal", recorded, status=2).err
    assert not list(stick.iterdir())


def test_the_dance_of_the_night_is_a_recording(recorded: Path, tmp_path: Path, bunraku: Command) -> None:
    bvh, glb = tmp_path / "night.bvh", tmp_path / "night.glb"
    said = bunraku("journal", "export", "--journal", recorded, "--bvh", bvh, "--glb", glb).out
    assert said.count("1.0 s of dance") == 2
    danced = read_journal(recorded)
    for found in (read_as_given(bvh)[0], read_as_given(glb)[0]):
        assert found.skeleton.same_joints(danced.skeleton)
        np.testing.assert_allclose(found.roots, danced.ticks["root"][:, 0], atol=1e-5)
        assert np.degrees(quaternion.angle_between(found.poses, danced.ticks["pose"][:, 0])).max() < 0.1


def test_of_several_puppets_the_one_that_is_written_is_named_and_may_be_chosen(
    tmp_path: Path, bunraku: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    night = Night(write_puppets(tmp_path / "show"), tmp_path / "runtime")
    night.dance(60)
    journal = night.saved(tmp_path / "journal")
    export = ("journal", "export", "--journal", journal, "--bvh", tmp_path / "one.bvh")
    assert "by left of left, right, late, slow (--puppet)" in bunraku(*export).out
    assert "by slow of left" in bunraku(*export, "--puppet", "slow").out
    danced = read_journal(journal).ticks["root"][:, 3]
    np.testing.assert_allclose(read_as_given(tmp_path / "one.bvh")[0].roots, danced, atol=1e-5)
    assert "no puppet 'nobody' danced" in bunraku(*export, "--puppet", "nobody", status=2).err
    alone = ("journal", "export", tmp_path / "out", "--journal", journal, "--puppet", "slow")
    assert "--puppet does nothing without --bvh or --glb" in bunraku(*alone, status=2).err
    drawn: list[Any] = []
    monkeypatch.setattr(pictures, "draw_strips", lambda *given: drawn.extend(given) or given[0])
    bunraku("filmstrip", journal, "--out", tmp_path / "all.png", "--seconds", "0.5", "--start", "0.6")
    _, _, strips, *_, start_s = drawn
    assert [strip.label for strip in strips] == ["left", "right", "late", "slow"] and start_s == 0.6
    assert strips[0].holds is not None and np.array_equal(strips[3].roots, danced[30:55])
    message = bunraku("filmstrip", journal, "--show", tmp_path / "show", "--up", "z", status=2).err
    assert "--show does nothing without --look" in message


def test_a_recording_has_the_ending_of_its_format(recorded: Path, tmp_path: Path, bunraku: Command) -> None:
    wrong = ("journal", "export", "--journal", recorded, "--bvh", tmp_path / "night.glb")
    assert "ends with .bvh" in bunraku(*wrong, status=2).err
    both = ("journal", "export", tmp_path, "--journal", recorded, "--bvh", tmp_path / "night.bvh")
    assert "leave out" in bunraku(*both, status=2).err


def test_without_a_stick_or_a_journal_it_says_what_to_do(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    monkeypatch.setattr(journal, "STICK", tmp_path / "absent")
    assert "No stick is at" in bunraku("journal", "export", "--journal", recorded, status=2).err
    (tmp_path / "box.yaml").write_text("{}\n")
    assert (
        "No box file names a journal"
        in bunraku("journal", "list", "--box", tmp_path / "box.yaml", status=2).err
    )


def test_on_a_box_it_is_the_journal_of_what_was_chosen(
    recorded: Path, stick: Path, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    """Without any option, as a technician types it."""
    monkeypatch.setattr(choice, "RUN", recorded.parent)
    box = recorded.with_name("box.yaml")
    box.write_text("journal: {folder: journal}\n")
    choice.Choice((choice.ShowAndBox(box=box),), (), ()).write(choice.RUN / choice.CHOSEN)
    assert "A test: 1 s, 20 late" in bunraku("journal", "list").out
    bunraku("journal", "export")
    (exported,) = stick.iterdir()
    assert len(read_journal(exported).ticks) == 50


def test_a_list_tells_what_happened(recorded: Path, bunraku: Command) -> None:
    run, order, said = bunraku("journal", "list", "--journal", recorded, "--events").out.splitlines()
    assert "A test: 1 s, 20 late" in run
    assert order.endswith("0.58 s  order: rate 0.5")
    assert said.endswith("said: The network gives poses again.")
