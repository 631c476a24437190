"""The shows that come with the box: each is whole, and its name stands for its folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from appliance.pose.bvh import read_bvh
from appliance.show.bundle import bundle_bytes, bundled_shows, default_show_path, named_show
from appliance.show.check import verify_bundle
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show

SHOWS = bundled_shows()


def test_the_default_show_is_the_first() -> None:
    assert list(SHOWS) == ["default", "martial"]
    assert SHOWS["default"] == default_show_path()


@pytest.mark.parametrize("name", SHOWS)
def test_a_show_that_comes_with_the_box_is_sound(name: str) -> None:
    assert verify_bundle(SHOWS[name]) == []
    assert "mocap.cs.cmu.edu" in load_show(SHOWS[name]).config.acknowledgement


def test_the_second_dancer_is_small_and_dances_another_phrase() -> None:
    assert bundle_bytes(SHOWS["martial"]) <= 5_000_000
    phrases = [read_bvh(load_show(show).phrase) for show in SHOWS.values()]
    assert phrases[0].skeleton.names == phrases[1].skeleton.names
    assert 20.0 <= phrases[1].seconds <= 40.0
    assert phrases[0].poses.shape != phrases[1].poses.shape


def test_a_name_stands_for_its_folder() -> None:
    assert named_show(Path("martial")) == SHOWS["martial"]
    assert named_show(None) is None
    assert named_show(Path("nowhere")) == Path("nowhere")


def test_a_show_in_a_folder_of_that_name_takes_precedence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("martial").mkdir()
    assert named_show(Path("martial")) == SHOWS["martial"]
    shutil.copy(SHOWS["default"] / "show.yaml", "martial")
    assert named_show(Path("martial")) == Path("martial")


@pytest.mark.parametrize(
    ("word", "cure"),
    [
        ("marital", "Did you mean 'martial', which comes with the box?"),
        ("my_show", "Check its path. Shows that come with the box: default, martial."),
        ("shows/martial", "Check its path. Shows that come with the box: default, martial."),
    ],
)
def test_an_unknown_name_names_the_nearest(word: str, cure: str) -> None:
    assert [finding.cure for finding in verify_bundle(word)] == [cure]
    with pytest.raises(ConfigError, match="There is no such show folder") as refused:
        load_show(word)
    assert cure in str(refused.value)
