"""The journal's list in a browser: newest first, faults marked, filtered by kind and by the time axis."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from tests.console.browser import ON_BOTH, press

pytestmark = pytest.mark.realtime

BEGUN, SECONDS, BINS = 1_767_800_000.0, 2400.0, 240
SILENT = "Sensor right-wrist is silent for 0.5 s. The dancer moves freely. Check its battery."


def night() -> dict[str, Any]:
    """40 minutes: a fault of two bins that touch, two commands, a message twice in a row."""
    counts: dict[str, Any] = {name: [0] * BINS for name in ("late", "skipped", "failed")}
    counts["late"][60:62], counts["skipped"][61] = [2, 3], 1
    slowest = [4.0] * BINS
    slowest[60:62] = [30.0, 44.0]
    events = [
        [100.0, "order", "look lines"],
        [1500.0, "said", SILENT],
        [1501.0, "said", SILENT],
        [2000.0, "order", "master 0.4 3.0 (refused)"],
    ]
    facts = {"number": 1, "begun": BEGUN, "show": "One hand", "seconds": SECONDS, "bin_s": SECONDS / BINS}
    return {**facts, **counts, "slowest_ms": slowest, "events": events}


@ON_BOTH
def test_the_list_has_the_newest_first_marks_what_is_severe_and_is_filtered(tab: Tab) -> None:
    tab.route("**/api/happened", lambda route: route.fulfill(json=[night()]))
    press(tab, '[data-page="happened"]')
    kinds, rows = tab.locator("#happened-kinds button"), tab.locator("#happened-events li")
    expect(kinds.locator("b")).to_have_text(["4", "1", "2", "1"])
    kinds_in_order = ["order", "said", "fault", "order"]
    assert [one.get_attribute("data-kind") for one in rows.all()] == kinds_in_order
    expect(tab.locator("#happened-events li.refused")).to_contain_text("Master: 40 % · 3 s (refused)")
    expect(rows.last).to_contain_text("Look: lines")
    press(tab, "#happened-kinds [data-kind=fault]")
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("late: 5, skipped: 1slowest tick 44.0 ms")
    press(tab, "#happened-kinds [data-kind=all]")
    axis = tab.locator("#timeline").bounding_box()
    assert axis is not None
    there = {"x": 52 + (axis["width"] - 60) * 1500 / SECONDS, "y": 30}
    tab.locator("#timeline").click(position=there)  # type: ignore[arg-type]
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("\u00d72")
    press(tab, "#happened-whole")
    expect(rows).to_have_count(4)
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")
