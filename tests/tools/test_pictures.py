"""The pictures of docs/dancer.md: drawn from what the compiled firmware's lamp really shows."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from tools.lamp_picture import GROUPS, draw_lamp
from tools.lamp_traces import SHOWN_S, Trace, traces
from tools.wearing_picture import draw_wearing
from tools.wiring_pictures import FOLDER, WIRINGS, drawing


@pytest.fixture(scope="module")
def shown() -> dict[str, Trace]:
    return traces()


def lit_s(trace: Trace) -> list[float]:
    """How long it is lit each time, without what the end of the trace cut off."""
    return [round(ended - begun, 2) for begun, ended in trace if ended < SHOWN_S]


def every_s(trace: Trace) -> list[float]:
    return [round(after[0] - before[0], 2) for before, after in pairwise(trace)]


def test_a_slow_blink_asks_to_stand_still(shown: dict[str, Trace]) -> None:
    assert lit_s(shown["neutral"]) == [0.5] * 8
    assert every_s(shown["neutral"]) == [1.0] * 7


def test_a_dancing_sensor_is_hardly_seen(shown: dict[str, Trace]) -> None:
    assert lit_s(shown["linked"]) == [0.06] * 3
    assert every_s(shown["linked"]) == [3.0] * 2


def test_a_strobed_sensor_flickers(shown: dict[str, Trace]) -> None:
    assert set(lit_s(shown["strobe"])) == {0.05}
    assert set(every_s(shown["strobe"])) == {0.1}


def test_flashes_are_counted(shown: dict[str, Trace]) -> None:
    assert every_s(shown["unprovisioned"])[:3] == [0.25, 1.75, 0.25]
    assert every_s(shown["no imu"])[:5] == [0.25, 0.25, 0.25, 0.25, 1.5]
    low = [flash for flash in shown["battery"] if flash[0] % 4.0 < 1.0]
    assert every_s(low) == [0.25, 0.25, 3.5, 0.25, 0.25]


def test_a_sensor_without_a_network_flickers_and_stays_lit_while_it_joins(shown: dict[str, Trace]) -> None:
    begun, ended = shown["joining"][-1]
    assert lit_s(shown["joining"])[0] == 0.1
    assert ended - begun > 4.0


def test_the_pictures_are_drawn(shown: dict[str, Trace], tmp_path: Path) -> None:
    rows = [row.trace for _, rows in GROUPS for row in rows]
    assert set(rows) == set(shown)
    assert all(0.0 <= begun < ended <= SHOWN_S for trace in shown.values() for begun, ended in trace)
    for picture in (draw_lamp(tmp_path / "lamp.png", shown), draw_wearing(tmp_path / "wearing.png")):
        assert picture.read_bytes().startswith(b"\x89PNG")


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
