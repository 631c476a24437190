"""Sensors and rehearsal in a browser."""

from __future__ import annotations

import pytest
from playwright.sync_api import Locator, expect
from playwright.sync_api import Page as Tab

from tests.console.browser import ON_A_LAPTOP, press, sensor_card, unlock
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime


def test_sensors_have_cards_and_take_their_neutral_pose(tab: Tab, venue: tuple[Box, Page]) -> None:
    unlock(tab, venue[1])
    press(tab, '[data-page="sensors"]')
    card = tab.locator(sensor_card("left-wrist"))
    expect(card).to_have_attribute("data-state", "linked")
    expect(card).to_contain_text("Battery")
    press(tab, sensor_card("left-wrist") + " >> text=Find")
    expect(tab.locator("#said")).not_to_be_empty()
    expect(tab.locator("#said")).not_to_have_class("refused")
    press(tab, "#neutral-all")
    expect(tab.locator("#said")).to_contain_text("neutral", ignore_case=True)


@ON_A_LAPTOP
def test_a_rehearsal_changes_iterations_and_hands(tab: Tab, venue: tuple[Box, Page]) -> None:
    _, page = venue
    unlock(tab, page)
    press(tab, '[data-page="rehearsal"]')
    coding = tab.locator("#coding")
    expect(coding).to_have_value("3")
    coding.focus()
    tab.keyboard.press("ArrowRight")
    wait_until(lambda: page.status()["status"]["coding"] == 4)
    coding.focus()
    tab.keyboard.press("ArrowLeft")
    wait_until(lambda: page.status()["status"]["coding"] == 3)
    lively = tab.locator("#liveliness")
    expect(lively).to_have_value("1")
    lively.focus()
    tab.keyboard.press("Home")
    expect(tab.locator("#liveliness-said")).to_contain_text("0.00")
    wait_until(lambda: page.status()["status"]["liveliness"] == 0.0)
    expect(tab.locator("#seed-said")).to_have_text("Seed 0")
    press(tab, "#seed-new")
    wait_until(lambda: page.status()["status"]["seed"] > 0)
    expect(tab.locator("#seed-said")).to_have_text(f"Seed {page.status()['status']['seed']}")
    hand = tab.locator("#hands button")
    expect(hand).to_have_attribute("aria-pressed", "true")
    press(tab, "#hands button")
    expect(hand).to_have_attribute("aria-pressed", "false")
    assert not page.status()["hands"][0]["holds"]
    press(tab, "#hands button")
    expect(hand).to_have_attribute("aria-pressed", "true")


def test_each_part_of_a_rehearsal_is_a_tap_away(tab: Tab) -> None:
    press(tab, '[data-page="rehearsal"]')
    parts, headings = tab.locator("#rehearsal-parts button:visible"), tab.locator("#rehearsal h2:visible")
    expect(parts.first).to_be_visible()
    assert parts.all_inner_texts() == headings.all_inner_texts()
    last = tab.locator("#rehearsal h2[data-words=learn]")
    assert not _is_seen(last)
    parts.last.tap()
    wait_until(lambda: _is_seen(last), "the page did not go there")
    assert _is_seen(tab.locator("#rehearsal-parts"))


def _is_seen(part: Locator) -> bool:
    """Between the sentence on top and the buttons at the bottom."""
    place = part.bounding_box()
    return place is not None and 80 < place["y"] < 600
