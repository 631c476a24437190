"""Blind pairs: a page of clips that gives nothing away, and votes that prove something or do not."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, sync_playwright

from appliance.studio.blind_pairs.votes import Preference, packed_key, result_of
from tests.studio.conftest import bunraku
from tools.page_pictures import CHROMIUM


def page_data(page: Path) -> dict[str, Any]:
    text = page.read_text()
    start = text.index("const data = ") + len("const data = ")
    found: dict[str, Any] = json.JSONDecoder().raw_decode(text[start:])[0]
    return found


def write_votes(
    file: Path, chosen: list[str], key: list[bool], voter: str = "anna", study: str = "s"
) -> Path:
    votes = [{"pair": pair, "chosen": side} for pair, side in enumerate(chosen)]
    facts = {"study": study, "voter": voter, "a": "one", "b": "other", "key": packed_key(key), "votes": votes}
    file.write_text(json.dumps(facts))
    return file


def test_wilsons_interval_is_that_of_the_textbook() -> None:
    low, high = Preference(14, 20).interval
    assert (round(low, 3), round(high, 3)) == (0.481, 0.855)
    low, high = Preference(0, 10).interval
    assert low == 0.0 and round(high, 3) == 0.278


def test_a_coins_votes_prove_nothing_and_those_of_people_who_see_a_difference_do() -> None:
    """The null product, exactly: how likely a coin's 20 votes are to have an interval without 50 %."""
    wrong = sum(math.comb(20, k) / 2**20 for k in range(21) if Preference(k, 20).is_shown)
    assert 0.03 < wrong < 0.05
    assert Preference(18, 20).is_shown and not Preference(13, 20).is_shown


def test_votes_are_counted_by_what_was_on_the_chosen_side(tmp_path: Path) -> None:
    key = [True, False] * 10
    sees = ["left" if is_left else "right" for is_left in key]
    found = result_of([write_votes(tmp_path / "a.json", sees, key)])
    assert found.first == Preference(20, 20) and found.left == Preference(10, 20)
    assert found.sentences() == [
        "one over other: 20 of 20 votes, 100% (95 % interval 84 to 100 %), 1 voter. one is preferred."
    ]
    lazy = result_of([write_votes(tmp_path / "b.json", ["left"] * 20, key)])
    assert not lazy.first.is_shown and "A side was preferred" in lazy.sentences()[1]
    both = result_of([tmp_path / "a.json", write_votes(tmp_path / "c.json", sees, key, "ben")])
    assert both.voters == 2 and both.first == Preference(40, 40)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"key": "AQ==", "votes": [{"pair": 7}]}'])
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "v.json").write_text(text)
    result = bunraku("compare-blind", "--votes", tmp_path / "v.json")
    assert result.exit_code == 2 and "has no votes" in " ".join(result.stderr.split())


def test_votes_of_two_pages_or_of_one_voter_twice_are_refused(tmp_path: Path) -> None:
    one = write_votes(tmp_path / "a.json", ["left"], [True])
    other = write_votes(tmp_path / "b.json", ["left"], [True], "ben", "another")
    for files, message in (([one, other], "another page"), ([one, one], "counted already")):
        asked = [each for file in files for each in ("--votes", file)]
        result = bunraku("compare-blind", *asked)
        assert result.exit_code == 2 and message in " ".join(result.stderr.split())


def test_sides_are_by_chance_and_as_often_left_as_right(recordings: Path, tmp_path: Path) -> None:
    page = tmp_path / "study.html"
    options = ["--pairs", 8, "--seconds", 2, "--out", page]
    for seed in (1, 2):
        result = bunraku(
            "compare-blind", recordings / "sway_0.bvh", recordings / "sway_1.bvh", *options, "--seed", seed
        )
        assert result.exit_code == 0, result.output
        data = page_data(page)
        key = list(base64.b64decode(data["key"]))
        assert sum(key) == 4 and key != sorted(key)
        assert len(data["pairs"]) == 8 and len(data["pairs"][0][0]["figures"]) == 50
        visible = page.read_text().split("<script>")[0]
        assert "sway_0" not in visible and "sway_1" not in visible
    assert "http" not in page.read_text()
    few = bunraku("compare-blind", recordings, recordings / "sway_1.bvh", "--seconds", 20, "--out", page)
    assert few.exit_code == 2 and "Give longer ones" in " ".join(few.stderr.split())


def test_a_voter_chooses_downloads_and_is_counted(recordings: Path, tmp_path: Path) -> None:
    page_file = tmp_path / "study.html"
    options = ["--pairs", 4, "--seconds", 2, "--out", page_file]
    assert (
        bunraku("compare-blind", recordings / "sway_0.bvh", recordings / "sway_1.bvh", *options).exit_code
        == 0
    )
    key = list(base64.b64decode(page_data(page_file)["key"]))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page: Page = browser.new_page()
        page.goto(page_file.as_uri())
        for number in range(4):
            assert page.inner_text("#foot") == f"pair {number + 1} of 4"
            pair = page.evaluate("self.order[self.votes.length]")
            page.keyboard.press("ArrowLeft" if key[pair] else "ArrowRight")
        with page.expect_download() as waiting:
            page.click("#download")
        waiting.value.save_as(tmp_path / "votes.json")
        browser.close()
    found = result_of([tmp_path / "votes.json"])
    assert found.first == Preference(4, 4) and found.names == ("sway_0", "sway_1")
