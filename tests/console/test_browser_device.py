"""The page about this device: whether it may control the box comes first, what takes that away comes last."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from tests.console.browser import press, unlock
from tests.console.page import Page
from tests.system.box import Box

pytestmark = pytest.mark.realtime


def test_its_own_state_is_first_the_others_are_listed_and_each_removal_asks(
    tab: Tab, venue: tuple[Box, Page]
) -> None:
    press(tab, '[data-page="device"]')
    expect(tab.locator("#known")).to_contain_text("This device may look")
    expect(tab.locator("#own-name")).not_to_be_empty()
    for gone in ("#own-part", "#devices-part"):
        expect(tab.locator(gone)).to_be_hidden()
    other = venue[1].post("/api/pin", {"pin": venue[1].pin, "name": "iPad, Safari"})
    assert other.status == 200
    unlock(tab, venue[1])
    press(tab, '[data-page="device"]')
    expect(tab.locator("#known")).to_have_text("This device may control the box.")
    expect(tab.locator("#own-since")).to_have_text(re.compile(r"PIN given on \d+ \w+ \d{4} at \d\d:\d\d"))
    listed = tab.locator("#devices li").filter(has_text="iPad, Safari")
    expect(listed).to_have_count(1)
    expect(tab.locator("#device button").last).to_have_text("Remove this device")
    press(tab, "#devices li:has-text('iPad') button")
    expect(listed.locator("button")).to_contain_text("Remove?")
    press(tab, "#devices li:has-text('iPad') button")
    expect(listed).to_have_count(0)
