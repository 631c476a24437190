"""Sensors and rehearsal in a browser."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from tests.console.browser import ON_A_LAPTOP, open_part, press, sensor_card, unlock
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime


def test_sensors_have_cards_and_take_their_neutral_pose(tab: Tab, venue: tuple[Box, Page]) -> None:
    unlock(tab, venue[1])
    press(tab, '[data-page="sensors"]')
    card = tab.locator(sensor_card("left-wrist"))
    expect(card).to_have_attribute("data-state", "linked")
    expect(card).to_contain_text("Last reading")
    expect(card).not_to_contain_text("Battery")  # emulated: what is not known is left out
    press(tab, sensor_card("left-wrist") + " >> text=Find")
    expect(tab.locator("#said")).not_to_be_empty()
    expect(tab.locator("#said")).not_to_have_class("refused")
    press(tab, "#neutral-all")
    expect(tab.locator("#said")).to_contain_text("neutral", ignore_case=True)


# From now on a spare is paired that was never heard.
SILENT_SPARE = """async () => {
  const { Box } = await import("/box.js"), hear = Box.prototype.hear;
  Box.prototype.hear = function (value) {
    const [worn] = value.sensors;
    value.sensors = [worn, { ...worn, name: "spare-1", heard: false, state: "absent", age_s: -1 }];
    hear.call(this, value);
  };
}"""


def test_what_a_silent_sensor_cannot_do_is_grey_and_says_why(tab: Tab) -> None:
    press(tab, '[data-page="sensors"]')
    tab.evaluate(SILENT_SPARE)
    for name, is_grey in (("left-wrist", "false"), ("spare-1", "true")):
        find = tab.locator(sensor_card(name)).get_by_text("Find")
        expect(find).to_have_attribute("aria-disabled", is_grey)
    tab.locator(sensor_card("spare-1")).get_by_text("Find").tap(force=True)
    expect(tab.locator("#said")).to_have_text("spare-1 sends nothing. Switch it on first.")
    expect(tab.locator("#pin")).to_be_hidden()
    expect(tab.locator("#neutral-all")).to_have_attribute("aria-disabled", "false")


@ON_A_LAPTOP
def test_a_rehearsal_changes_iterations_and_hands(tab: Tab, venue: tuple[Box, Page]) -> None:
    _, page = venue
    unlock(tab, page)
    press(tab, '[data-page="rehearsal"]')
    open_part(tab, "iterations")
    coding = tab.locator("#coding")
    expect(coding).to_have_value("3")
    coding.focus()
    tab.keyboard.press("ArrowRight")
    wait_until(lambda: page.status()["status"]["coding"] == 4)
    coding.focus()
    tab.keyboard.press("ArrowLeft")
    wait_until(lambda: page.status()["status"]["coding"] == 3)
    open_part(tab, "answer")
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
    open_part(tab, "hands")
    hand = tab.locator("#hands button")
    expect(hand).to_have_attribute("aria-pressed", "true")
    press(tab, "#hands button")
    expect(hand).to_have_attribute("aria-pressed", "false")
    assert not page.status()["hands"][0]["holds"]
    press(tab, "#hands button")
    expect(hand).to_have_attribute("aria-pressed", "true")


def test_each_part_of_a_rehearsal_is_a_tap_away_with_the_figure_in_view(tab: Tab) -> None:
    press(tab, '[data-page="rehearsal"]')
    buttons = tab.locator("#rehearsal-parts button:visible")
    opened = tab.locator("#rehearsal [data-part]:visible")
    expect(buttons.first).to_have_attribute("aria-pressed", "true")
    assert buttons.count() > 4
    for button in buttons.all():
        button.tap()
        expect(opened).to_have_count(1)
        expect(opened).to_have_attribute("data-part", button.get_attribute("data-opens") or "")
        for part in (tab.locator("#figure"), opened):
            place = part.bounding_box()
            assert place is not None and 80 < place["y"] < 640, "between the sentence on top and the buttons"
