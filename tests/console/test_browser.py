"""The page as people use it: a real Chromium, by touch and by mouse, against the real box."""

from __future__ import annotations

import contextlib
import signal
import socket
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, expect, sync_playwright
from playwright.sync_api import Page as Tab

from appliance.box.show_state import ShowState, ShowStateReader
from appliance.outputs.frame_reader import FrameReader
from appliance.pose.bvh import read_bvh
from appliance.recorder.journal_error import JournalError
from appliance.recorder.reading import Run, read_journal
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import PATIENCE_S, children_running, wait_until
from tools.page_pictures import take_pictures

pytestmark = pytest.mark.realtime

PATIENCE_MS = 1000 * PATIENCE_S
CHROMIUM = "/usr/bin/chromium"
PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
LAPTOP: dict[str, Any] = {"viewport": {"width": 1280, "height": 800}}
MOST_TRANSFER = 700_000
LEAST_CONTRAST = 4.5  # WCAG 2.2, 1.4.3


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture(params=[PHONE, LAPTOP], ids=["phone", "laptop"])
def context(request: pytest.FixtureRequest, browser: Browser) -> Iterator[BrowserContext]:
    made = browser.new_context(**request.param, locale="en-GB")
    made.set_default_timeout(PATIENCE_MS)
    yield made
    made.close()


@pytest.fixture
def tab(context: BrowserContext, venue: tuple[Box, Page]) -> Iterator[Tab]:
    """The page, opened; an error of its scripts fails the test."""
    expect.set_options(timeout=PATIENCE_MS)
    opened = context.new_page()
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.goto(venue[1].origin)
    opened.wait_for_selector("body[data-heard]")
    yield opened
    assert not errors


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


def declared(box: Box) -> ShowState:
    reader = ShowStateReader(box.runtime)
    found = reader.read()
    reader.close()
    return found


def test_panic_asks_for_the_pin_once_and_is_then_done(tab: Tab, venue: tuple[Box, Page]) -> None:
    box, page = venue
    press(tab, "#panic")
    expect(tab.locator("#pin")).to_be_visible()
    tab.fill("#pin-input", f"{(int(page.pin) + 1) % 1_000_000:06}")
    press(tab, "#pin-send")
    expect(tab.locator("#pin-said")).to_have_text("This is not the PIN.")
    assert not declared(box).panic
    tab.fill("#pin-input", page.pin)
    press(tab, "#pin-send")
    expect(tab.locator("#verdict")).to_contain_text("PANIC is in force")
    expect(tab.locator("#panic")).to_have_attribute("aria-pressed", "true")
    assert declared(box).panic
    press(tab, "#go")
    expect(tab.locator("#panic")).to_have_attribute("aria-pressed", "false")
    assert not declared(box).panic
    tab.reload()
    tab.wait_for_selector("body[data-heard]")
    press(tab, "#panic")
    wait_until(lambda: declared(box).panic, "the device was forgotten")
    press(tab, "#go")
    wait_until(lambda: not declared(box).panic)


def test_an_evening_by_its_buttons(tab: Tab, venue: tuple[Box, Page]) -> None:
    box, page = venue
    unlock(tab, page)
    press(tab, '[data-page="tonight"]')
    press(tab, "#blackout")
    wait_until(lambda: declared(box).blackout)
    expect(tab.locator("#blackout")).to_have_attribute("aria-pressed", "true")
    press(tab, "#blackout")
    wait_until(lambda: not declared(box).blackout)
    press(tab, "#stop")
    expect(tab.locator("#verdict")).to_contain_text("stopped")
    press(tab, "#go")
    wait_until(lambda: declared(box).going)
    press(tab, "#cues >> text=storm")
    wait_until(lambda: declared(box).cue == "storm")
    expect(tab.locator("#cues >> text=storm")).to_have_attribute("aria-pressed", "true")
    tab.locator("#master").focus()
    tab.keyboard.press("Home")
    wait_until(lambda: declared(box).master == 0.0)
    expect(tab.locator("#verdict")).to_contain_text("0 %")
    tab.locator("#master").focus()
    tab.keyboard.press("End")
    wait_until(lambda: declared(box).master == 1.0)


def test_the_dance_is_seen_as_it_leaves_the_box(tab: Tab, venue: tuple[Box, Page]) -> None:
    box, _ = venue
    reader = FrameReader(box.runtime)
    press(tab, '[data-page="dance"]')
    await_true(tab, "Number(document.body.dataset.tick) > 0")
    expect(tab.locator("#held")).to_contain_text("Held:")
    await_true(tab, "/^lShldr [01][.][0-9]{2}$/.test(document.body.dataset.held)")
    before = tab.locator("#stage").screenshot()
    drawn = tab.evaluate("[document.body.dataset.tick, document.body.dataset.root]")
    seen = {frame.tick: frame.root for frame in reader.frames(60, time.monotonic())}
    assert np.allclose([float(part) for part in drawn[1].split()], seen[int(drawn[0])], atol=0.001)
    await_true(tab, f"Number(document.body.dataset.tick) > {int(drawn[0]) + 20}")
    assert tab.locator("#stage").screenshot() != before, "the figure moves"
    tab.locator("#show-dance").uncheck()
    expect(tab.locator("#held")).not_to_contain_text("No frame")
    tab.wait_for_timeout(700)  # what was on its way has come
    count = tab.evaluate("document.body.dataset.frames")
    tab.wait_for_timeout(1000)
    assert tab.evaluate("document.body.dataset.frames") == count, "switched off, it costs nothing"
    tab.locator("#show-dance").check()
    await_true(tab, f"Number(document.body.dataset.frames) > {count}")
    reader.close()


def test_sensors_have_cards_and_take_their_neutral_pose(tab: Tab, venue: tuple[Box, Page]) -> None:
    unlock(tab, venue[1])
    press(tab, '[data-page="sensors"]')
    card = tab.locator('article[data-sensor="left-wrist"]')
    expect(card).to_have_attribute("data-state", "linked")
    expect(card).to_contain_text("Battery")
    press(tab, 'article[data-sensor="left-wrist"] >> text=Find')
    expect(tab.locator("#said")).not_to_be_empty()
    expect(tab.locator("#said")).not_to_have_class("refused")
    press(tab, "#neutral-all")
    expect(tab.locator("#said")).to_contain_text("neutral", ignore_case=True)


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
    hand = tab.locator("#hands button")
    expect(hand).to_have_attribute("aria-pressed", "true")
    press(tab, "#hands button")
    expect(hand).to_have_attribute("aria-pressed", "false")
    assert not page.status()["hands"][0]["holds"]
    press(tab, "#hands button")
    expect(hand).to_have_attribute("aria-pressed", "true")


def test_what_happened_is_danced_again(tab: Tab, venue: tuple[Box, Page]) -> None:
    """The journal's newest run: a timeline, and a stretch of it in 3D, the poses those of the journal."""
    wait_until(lambda: len(recorded(venue[0]).ticks) > 100, "nothing was recorded")
    press(tab, '[data-page="happened"]')
    expect(tab.locator("#happened-sum")).to_contain_text("late ticks")
    assert tab.evaluate("document.querySelector('#timeline').width") > 200
    tab.locator("#happened-second").fill("0")
    press(tab, "#happened-dance")
    expect(tab.locator("#again")).to_be_visible()
    await_true(tab, "Boolean(document.body.dataset.tick)")
    seen = {
        tab.evaluate("[+document.body.dataset.tick, document.body.dataset.root].join(' ')") for _ in range(20)
    }
    ticks = recorded(venue[0]).ticks
    for one in seen:
        tick, *root = map(float, one.split())
        (row,) = ticks[ticks["tick"] == tick]
        positions, _ = recorded(venue[0]).skeleton.forward_kinematics(row["pose"], row["root"])
        np.testing.assert_allclose(root, positions[0], atol=2e-3)
    with tab.expect_download() as download:
        press(tab, "#happened-bvh")
    dance = read_bvh(download.value.path(), metres_per_unit=0.01)
    assert dance.seconds > 1.0
    press(tab, '[data-page="tonight"]')
    expect(tab.locator("#again")).to_be_hidden()


def test_the_box_tells_its_release_and_addresses(tab: Tab, venue: tuple[Box, Page]) -> None:
    press(tab, '[data-page="box"]')
    expect(tab.locator("#box-release")).to_contain_text(version("bunraku"))
    expect(tab.locator("#box-release")).to_contain_text(venue[0].box_file.name)
    expect(tab.locator("#box-network")).to_contain_text(socket.gethostname())
    expect(tab.locator("#box-clock")).to_contain_text("Clock of the box: ")
    expect(tab.locator("#box-shows-part")).to_be_hidden()


def test_the_box_tells_which_shows_it_has(tab: Tab) -> None:
    """As an installed box answers, with names that no page may take for its own text."""
    told = {
        "shows": [{"source": "<b>stick</b>", "good": False}, {"source": "comes with the box", "good": True}],
        "refused": ["show.yaml:3: no such key."],
        "aside": ["It was too slow."],
        "box_file": "/data/box.yaml",
        "version": "2.0",
        "release": "2.0",
        "releases": ["1.9", "2.0"],
        "host": "stage",
        "addresses": [["eth0", "192.0.2.7"]],
    }
    tab.route("**/api/box", lambda route: route.fulfill(json=told))
    press(tab, '[data-page="box"]')
    dances, instead = (tab.locator("#box-shows li").nth(place) for place in (0, 1))
    expect(dances).to_contain_text("<b>stick</b>chosen at power-on · has not danced here yet")
    expect(instead).to_contain_text("dances if the one above does not · has danced here")
    expect(tab.locator("#box-refused li")).to_have_text(["show.yaml:3: no such key.", "It was too slow."])
    expect(tab.locator("#box-releases li")).to_have_text(["1.9", "2.0dances"])
    expect(tab.locator("#box-rollback")).to_be_visible()
    expect(tab.locator("#box-network")).to_contain_text("192.0.2.7")


def recorded(box: Box) -> Run:
    with contextlib.suppress(JournalError):
        return read_journal(box.box_file.parent / "night").runs[-1]
    return cast(Run, SimpleNamespace(ticks=()))


def test_a_thumb_that_scrolls_over_panic_does_nothing(browser: Browser, venue: tuple[Box, Page]) -> None:
    box, page = venue
    context = browser.new_context(**PHONE)
    context.set_default_timeout(PATIENCE_MS)
    tab = context.new_page()
    tab.goto(page.origin)
    tab.wait_for_selector("body[data-heard]")
    unlock(tab, page)
    tab.tap('[data-page="tonight"]')
    place = tab.locator("#panic").bounding_box()
    assert place is not None and place["width"] >= 150 and place["height"] >= 64
    x, y = place["x"] + 60, place["y"] + 60
    touch = context.new_cdp_session(tab)
    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for step in range(1, 11):
        moved = {"x": x + 3 * step, "y": y - 5 * step}
        touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [moved]})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    tab.wait_for_timeout(1000)
    assert not declared(box).panic
    tab.tap("#panic")
    wait_until(lambda: declared(box).panic, "a tap in the same place acts")
    tab.tap("#go")
    wait_until(lambda: not declared(box).panic)
    context.close()


def test_the_page_s_process_is_killed_and_comes_back(tab: Tab, venue: tuple[Box, Page]) -> None:
    import os

    box, _ = venue
    (process,) = children_running(box.process.pid, "appliance.console")
    os.kill(process, signal.SIGSTOP)
    expect(tab.locator("#verdict")).to_contain_text("No word from the box")
    os.kill(process, signal.SIGKILL)
    expect(tab.locator("#verdict")).not_to_contain_text("No word from the box")
    heard = tab.evaluate("document.body.dataset.heard")
    await_true(tab, f"Number(document.body.dataset.heard) > {heard}")


def test_after_the_phone_slept_the_page_is_back(browser: Browser, venue: tuple[Box, Page]) -> None:
    """A frozen page runs no scripts, as behind a locked screen."""
    context = browser.new_context(**PHONE)
    context.set_default_timeout(PATIENCE_MS)
    tab = context.new_page()
    tab.goto(venue[1].origin)
    tab.wait_for_selector("body[data-heard]")
    sleep = context.new_cdp_session(tab)
    sleep.send("Page.setWebLifecycleState", {"state": "frozen"})
    time.sleep(6.0)
    sleep.send("Page.setWebLifecycleState", {"state": "active"})
    woken = time.time()
    await_true(tab, f"Number(document.body.dataset.heard) > {woken}")
    expect(tab.locator("#verdict")).not_to_contain_text("No word from the box")
    context.close()


def test_nothing_comes_from_elsewhere_and_little_comes_at_all(
    context: BrowserContext, venue: tuple[Box, Page]
) -> None:
    origin = venue[1].origin
    tab = context.new_page()
    asked: list[str] = []
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(origin)
    tab.wait_for_selector("body[data-ready]")
    assert asked and all(url.startswith(origin) for url in asked)
    transferred = tab.evaluate(
        "performance.getEntriesByType('resource').concat(performance.getEntriesByType('navigation'))"
        ".reduce((sum, one) => sum + one.transferSize, 0)"
    )
    assert 0 < transferred <= MOST_TRANSFER


def test_it_speaks_german_to_a_german_phone(browser: Browser, venue: tuple[Box, Page]) -> None:
    context = browser.new_context(**PHONE, locale="de-AT")
    context.set_default_timeout(PATIENCE_MS)
    tab = context.new_page()
    tab.goto(venue[1].origin)
    expect(tab.locator("#panic")).to_have_text("PANIK")
    expect(tab.locator("html")).to_have_attribute("lang", "de")
    tab.tap('[data-page="device"]')
    tab.tap("#languages >> text=English")
    expect(tab.locator("#panic")).to_have_text("PANIC")
    context.close()


# Each control that is seen: its name, and the contrast of its text with what lies behind it.
SEEN = """() => {
  const light = (colour) => {
    const parts = colour.match(/[\\d.]+/g).slice(0, 3).map((part) => part / 255)
      .map((part) => part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4);
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2];
  };
  const behind = (one) => {
    const colour = getComputedStyle(one).backgroundColor;
    const clear = colour === 'rgba(0, 0, 0, 0)';
    return clear && one.parentElement ? behind(one.parentElement) : clear ? 'rgb(21, 23, 26)' : colour;
  };
  return [...document.querySelectorAll('button, input, canvas, p, dt, dd, h2, h3, li, small, label')]
    .filter((one) => one.offsetParent !== null || one.closest('footer'))
    .map((one) => {
      const [a, b] = [light(getComputedStyle(one).color), light(behind(one))].sort();
      const name = one.getAttribute('aria-label') || one.labels?.[0]?.textContent || one.textContent;
      const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
      return { tag: one.tagName, id: one.id, name: name.trim(), contrast };
    });
}"""


def test_every_control_has_a_name_and_can_be_read(tab: Tab) -> None:
    for page in ("tonight", "dance", "sensors", "rehearsal", "picture", "device"):
        press(tab, f'[data-page="{page}"]')
        for one in tab.evaluate(SEEN):
            if one["tag"] in ("BUTTON", "INPUT", "CANVAS"):
                assert one["name"], one
            if one["name"] and one["tag"] not in ("INPUT", "CANVAS"):
                assert one["contrast"] >= LEAST_CONTRAST, one
        assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth"), f"{page} scrolls sideways"


def test_the_keyboard_reaches_panic(tab: Tab, venue: tuple[Box, Page]) -> None:
    box, page = venue
    unlock(tab, page)
    for _ in range(60):
        tab.keyboard.press("Tab")
        if tab.evaluate("document.activeElement.id") == "panic":
            break
    tab.keyboard.press("Enter")
    wait_until(lambda: declared(box).panic)
    press(tab, '[data-page="tonight"]')
    tab.locator("#go").press("Enter")
    wait_until(lambda: not declared(box).panic)


def test_pictures_of_each_page(browser: Browser, tmp_path: Path, venue: tuple[Box, Page]) -> None:
    """`python -m tools.page_pictures` draws what docs/technician.md shows; here beside a box of the test."""
    taken = take_pictures(browser, venue[1].origin, tmp_path)
    assert [path.name for path in taken] == ["page-tonight.png", "page-dance.png", "page-sensors.png"]
    assert all(5_000 < path.stat().st_size < 200_000 for path in taken)
