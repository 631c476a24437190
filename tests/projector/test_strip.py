"""Strips of rendered pictures, and the picture at the end of a rehearsal."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from appliance.cli.pictures import load_dance, render_dance
from appliance.cli.rehearsal import has_display, rehearsal_picture
from appliance.pictures.filmstrip import held_throughout
from appliance.projector import strip
from appliance.projector.strip import COLUMNS, PICTURE, ROWS, render_strip
from appliance.recorder.journal_reader import read_journal
from appliance.show.look import looks_by_name
from appliance.show.show import load_show
from appliance.stage.stage_error import StageError
from tests.bundles import FIGURE, swaying_phrase, write_show
from tests.recorder.night import Night

WIDTH, HEIGHT = PICTURE
SMALL = (WIDTH // 2, HEIGHT // 2)
LARGEST_BYTES = 1_500_000


@pytest.fixture
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each picture is half as wide and half as high: software draws it in a quarter of the time."""
    monkeypatch.setattr(strip, "PICTURE", SMALL)


def pictures_of(path: Path) -> list[np.ndarray]:
    """The single pictures of a strip, row by row."""
    strip_ = np.asarray(Image.open(path).convert("RGB")).astype(int)
    rows = np.split(strip_, len(strip_) // strip.PICTURE[1])
    return [one for row in rows for one in np.split(row, COLUMNS, axis=1)]


def write_journal(path: Path, ticks: int = 100) -> Path:
    """A journal of a sway, as `play` leaves it."""
    night = Night(write_show(path.parent / "danced"), path.parent / "runtime")
    night.dance(ticks)
    return night.saved(path)


@pytest.mark.parametrize("look", ["plaster", "lines"])
def test_ten_instants_side_by_side(tmp_path: Path, look: str) -> None:
    dance = swaying_phrase()
    out = render_strip(
        tmp_path / "deep" / "strip.png",
        [dance],
        looks_by_name(()),
        look,
        held_throughout(dance.poses, [2])[:, None],
    )
    assert Image.open(out).size == (COLUMNS * WIDTH, ROWS * HEIGHT)
    assert out.stat().st_size < LARGEST_BYTES
    pictures = pictures_of(out)
    assert len(pictures) == COLUMNS * ROWS
    for before, picture in pairwise(pictures):
        assert picture.max() > 150, "no dancer is to be seen"
        assert np.abs(picture - before).max() > 50, "the dancer does not move"


@pytest.mark.usefixtures("_small")
def test_two_poses_give_two_pictures_and_black(tmp_path: Path) -> None:
    dance = swaying_phrase(0.04)
    out = render_strip(tmp_path / "two.png", [dance], looks_by_name(()), "plaster")
    pictures = pictures_of(out)
    assert len(pictures) == COLUMNS
    assert pictures[0].max() > 150
    assert pictures[-1].max() == 0


@pytest.mark.usefixtures("_small")
def test_looks_come_from_the_show(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show")
    with (show / "show.yaml").open("a") as file:
        file.write("looks: [{name: dusk, style: plaster, exposure: 0.3}]\n")
    dance = load_dance(show / "phrase.bvh").part(0.0, 0.1)
    dark = pictures_of(render_dance(dance, tmp_path / "dark.png", "dusk", show))
    bright = pictures_of(render_dance(dance, tmp_path / "bright.png", "plaster", None))
    assert 0 < dark[0].mean() < bright[0].mean()
    with pytest.raises(StageError, match=r"There is no look 'plaster'\. There are: dusk"):
        render_dance(dance, tmp_path / "none.png", "plaster", show)


@pytest.mark.parametrize(
    ("environment", "is_there"),
    [
        ({}, False),
        ({"DISPLAY": ""}, False),
        ({"DISPLAY": ":0"}, True),
        ({"WAYLAND_DISPLAY": "wayland-1"}, True),
    ],
)
def test_a_display_is_known_by_the_environment(environment: dict[str, str], is_there: bool) -> None:
    assert has_display(environment) == is_there


def test_a_rehearsal_ends_with_a_rendered_picture(tmp_path: Path) -> None:
    show = load_show(write_show(tmp_path / "show"))
    out = tmp_path / "dance.png"
    (said,) = rehearsal_picture(write_journal(tmp_path / "run.journal"), out, show)
    assert said == f"The dance just now, as the projector shows it: {out}"
    assert Image.open(out).size == (COLUMNS * WIDTH, ROWS * HEIGHT)


def test_without_opengl_a_rehearsal_ends_with_a_filmstrip_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", str(tmp_path / "absent.json"))
    show = load_show(write_show(tmp_path / "show"))
    out = tmp_path / "dance.png"
    why, said = rehearsal_picture(write_journal(tmp_path / "run.journal"), out, show)
    assert "cannot be rendered here" in why
    for package in ("libgl1-mesa-dri", "libegl1", "libgles2", "libgbm1"):
        assert package in why
    assert str(out) in said
    assert out.read_bytes().startswith(b"\x89PNG")


def test_a_part_of_a_dance_counts_from_either_end(tmp_path: Path) -> None:
    dance = load_dance(write_journal(tmp_path / "run.journal"))
    assert dance.holds is not None and dance.holds.shape == (len(dance.recordings[0]), 1, len(FIGURE))
    weights = read_journal(tmp_path / "run.journal").ticks["weights"][:, 0]
    assert np.array_equal(dance.holds[:, 0, FIGURE.index("lShldr")], weights), "as the ticks say"
    assert len(dance.part(-1.0, 10.0).recordings[0]) == 50
    assert len(dance.part(-100.0, 10.0).recordings[0]) == 100
    assert len(dance.part(0.5, 0.5).recordings[0]) == 25
    with pytest.raises(StageError, match="nothing was danced after second 2"):
        dance.part(2.0, 1.0)
