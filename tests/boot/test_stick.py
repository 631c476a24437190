"""Shows come on a stick: a sound one is danced, a broken or half-read one never stops the show."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.boot.box import Box
from tests.boot.figures import Figures
from tests.boot.stick import Stick, show_on

pytestmark = pytest.mark.boot


def _name_of_the_show(box: Box) -> str:
    """As show control tells it."""
    return str(
        box.machine.await_that(
            lambda: [
                text[0] for where, text in box.hall.ask("/status", 0.5) if where == "/bunraku/status/show"
            ],
            "show control does not answer",
        )[0]
    )


def test_a_new_show_is_danced_and_kept_and_a_broken_one_refused_with_file_and_line(
    box: Box, tmp_path: Path, figures: Figures
) -> None:
    show_on(tmp_path / "content", "From the stick")
    stick = Stick.made(tmp_path / "stick.img", tmp_path / "content")
    box.power_on(stick=stick.image)
    first = box.await_frames()[0]
    figures.note("power-on with a new show on the stick to first frame", first.at - box.machine.powered_at)
    assert _name_of_the_show(box) == "From the stick", box.machine.log("bunraku-preflight", "bunraku-stage")
    box.machine.await_that(box.is_proven, "the show is not kept as one that dances")
    box.machine.cut_power()
    show = show_on(tmp_path / "broken", "Broken") / "show.yaml"
    show.write_text(show.read_text().replace("coding_iterations: 10", "coding_iteration: 10"))
    line = next(
        number for number, text in enumerate(show.read_text().splitlines(), 1) if "coding_iteration:" in text
    )
    box.power_on(stick=Stick.made(tmp_path / "broken.img", tmp_path / "broken").image)
    box.await_frames()
    assert _name_of_the_show(box) == "From the stick", "it is gone with its stick"
    said = box.machine.log("bunraku-preflight")
    assert f"/media/bunraku/bunraku/show/show.yaml:{line}" in said, said
    assert "coding_iterations" in said, "the nearest name is not told"
    assert any(f"show.yaml:{line}" in path.read_text() for path in _refusals(box)), said


def test_a_stick_that_is_pulled_while_it_is_read(box: Box, tmp_path: Path, figures: Figures) -> None:
    show = show_on(tmp_path / "content", "Half read")
    (show / "zz-long.bvh").write_bytes(os.urandom(200 << 20))
    stick = Stick.made(tmp_path / "stick.img", tmp_path / "content", megabytes=260)
    box.disk.grown(1024)
    box.power_on(stick=stick.image)
    shows = box.machine.path("/data/bunraku/shows")
    box.machine.await_that(lambda: list(shows.glob("*part*/zz-long.bvh")), "the stick is not read")
    box.machine.run("systemctl", "kill", "--signal=STOP", "bunraku-preflight")
    assert list(shows.glob("*part*/zz-long.bvh")), "it was read before it could be pulled"
    stick.pull()
    box.machine.run("systemctl", "kill", "--signal=CONT", "bunraku-preflight")
    first = box.await_frames()[0]
    figures.note(
        "power-on with a stick that is pulled to first frame",
        first.at - box.machine.powered_at,
    )
    assert _name_of_the_show(box) == "One hand"
    assert not list(shows.glob("*part*")), "what was half read has been kept"
    said = box.machine.log("bunraku-preflight")
    assert "stick" in said and "goes on" in said, said


def _refusals(box: Box) -> list[Path]:
    return list(box.machine.path("/data/bunraku/refusals").glob("*.txt"))
