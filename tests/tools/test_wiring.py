"""The wiring drawings: one for each board that the firmware is built for, as the tool draws it."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from tools.wiring_pictures import FOLDER, WIRINGS, drawing

ROOT = Path(__file__).parents[2]


def test_every_board_has_a_drawing_and_the_page_shows_it() -> None:
    profiles = yaml.safe_load((ROOT / "firmware/wearable/sketch.yaml").read_text())["profiles"]
    assert set(WIRINGS) == set(profiles)
    page = (ROOT / "docs" / "build-a-wearable.md").read_text()
    assert all(f"pictures/wiring-{profile}.svg" in page for profile in profiles)


@pytest.mark.parametrize("profile", WIRINGS)
def test_a_drawing_is_as_the_tool_draws_it(profile: str) -> None:
    text = (FOLDER / f"wiring-{profile}.svg").read_text(encoding="utf-8")
    assert text == drawing(WIRINGS[profile])
    ElementTree.fromstring(text)


@pytest.mark.parametrize("profile", WIRINGS)
def test_the_page_names_the_pins_of_the_drawing(profile: str) -> None:
    wiring = WIRINGS[profile]
    board = re.sub(r"^(Arduino|Seeed) ", "", wiring.board)
    page = (ROOT / "docs" / "build-a-wearable.md").read_text()
    row = next(
        line
        for line in page.splitlines()
        if line.startswith(f"| {board} |") and f"| {wiring.supply} |" in line
    )
    assert {wiring.data.split()[-1], wiring.clock.split()[-1]} <= {cell.strip() for cell in row.split("|")}
