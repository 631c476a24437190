"""The boxes of a network in a browser: a box is ticked, asks for its PIN, and tells what came of the show."""

from __future__ import annotations

import json
from typing import Any

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import Route, expect

from tests.console.browser import press, unlock
from tests.console.page import Page
from tests.system.box import Box

pytestmark = pytest.mark.realtime

WELL = {"level": "well", "key": "well", "values": {}}
BOXES = [
    {
        "host": "left.local",
        "origin": "http://192.0.2.5:8080",
        "version": "1",
        "verdict": WELL,
        "show": "Before",
    },
    {"host": "away.local", "origin": "http://192.0.2.6:8080", "version": "1"},
]


def test_a_ticked_box_asks_for_its_pin_and_takes_the_show(tab: Tab, venue: tuple[Box, Page]) -> None:
    """The other boxes are made up; tests.console.test_fleet.py has real ones."""
    asked: list[Any] = []

    def pushed(route: Route) -> None:
        asked.append(route.request.post_data_json)
        state = "taken" if asked[-1]["pin"] == "123456" else "pin"
        route.fulfill(json={"state": state, "message": "It counts now." if state == "taken" else ""})

    tab.route("**/api/fleet", lambda route: route.fulfill(body=json.dumps(BOXES)))
    tab.route("**/api/fleet/push", pushed)
    unlock(tab, venue[1])
    press(tab, '[data-page="box"]')
    expect(tab.locator("#fleet-push")).to_be_hidden()
    press(tab, "#fleet-read")
    expect(tab.locator("#fleet li")).to_contain_text(["left.local", "away.local"])
    expect(tab.locator("#fleet [type=checkbox]").nth(1)).to_be_disabled()
    for _ in range(2):
        press(tab, "#fleet-push")
    expect(tab.locator("#fleet-said")).to_have_text("Tick the boxes that get the show.")
    assert asked == []
    tab.locator("#fleet [type=checkbox]").first.check()
    for _ in range(2):
        press(tab, "#fleet-push")
    expect(tab.locator("#fleet output").first).to_contain_text("Give the PIN of that box")
    tab.locator("#fleet .pin").first.fill("123456")
    for _ in range(2):
        press(tab, "#fleet-push")
    expect(tab.locator("#fleet output").first).to_have_text("Taken. It counts now.")
    expect(tab.locator("#fleet .pin").first).to_be_hidden()
    assert asked == [{"host": "left.local", "pin": ""}, {"host": "left.local", "pin": "123456"}]
