"""A browser as people hold it: the two sizes of its window, a press, the PIN; and what the box was told."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import BrowserContext, expect
from playwright.sync_api import Page as Tab

from appliance.box.show_state import ShowState, ShowStateReader
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import PATIENCE_S, wait_until

PATIENCE_MS = 1000 * PATIENCE_S
PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
LAPTOP: dict[str, Any] = {"viewport": {"width": 1280, "height": 800}}
ON_A_LAPTOP = pytest.mark.parametrize("context", [LAPTOP], ids=["laptop"], indirect=True)
# For what finger and mouse do differently, and for the layout of a page.
ON_BOTH = pytest.mark.parametrize("context", [PHONE, LAPTOP], ids=["phone", "laptop"], indirect=True)


def press(tab: Tab, where: str) -> None:
    """By finger on a phone, by mouse on a laptop."""
    is_phone = tab.evaluate("matchMedia('(pointer: coarse)').matches")
    (tab.tap if is_phone else tab.click)(where)


def await_true(tab: Tab, script: str) -> None:
    """Playwright's own waiting compiles texts in the page, which the page's policy forbids."""
    wait_until(lambda: tab.evaluate(script), script)


def unlock(tab: Tab, page: Page) -> None:
    press(tab, '[data-page="device"]')
    press(tab, "#give-pin")
    tab.fill("#pin-input", page.pin)
    press(tab, "#pin-send")
    expect(tab.locator("body")).to_have_attribute("data-known", "yes")


def unlocked_tab(context: BrowserContext, page: Page, which: str) -> Tab:
    """A new tab on a device that gave the PIN, on one of the pages."""
    expect.set_options(timeout=PATIENCE_MS)
    context.set_default_timeout(PATIENCE_MS)
    tab = context.new_page()
    tab.goto(page.origin)
    tab.wait_for_selector("body[data-heard]")
    unlock(tab, page)
    press(tab, f'[data-page="{which}"]')
    return tab


def declared(box: Box) -> ShowState:
    reader = ShowStateReader(box.runtime)
    found = reader.read()
    reader.close()
    return found
