"""A browser as people hold it: the two sizes of its window, a press, the PIN; and what the box was told."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, expect
from playwright.sync_api import Page as Tab

from appliance.box.show_state import ShowStateReader
from appliance.levers.show_state import ShowState
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import PATIENCE_S, wait_until

PATIENCE_MS = 1000 * PATIENCE_S
PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
LAPTOP: dict[str, Any] = {"viewport": {"width": 1280, "height": 800}}
ON_A_LAPTOP = pytest.mark.parametrize("context", [LAPTOP], ids=["laptop"], indirect=True)
# For what finger and mouse do differently, and for the layout of a page.
ON_BOTH = pytest.mark.parametrize("context", [PHONE, LAPTOP], ids=["phone", "laptop"], indirect=True)
# A sentence stays for three seconds, a question and a request for six: one that is held up finds them still.
_PATIENT = f"""{{
  const later = setTimeout, ends = AbortSignal.timeout.bind(AbortSignal);
  window.setTimeout = (act, ms, ...given) => later(act, ms >= 3000 ? {PATIENCE_MS} : ms, ...given);
  AbortSignal.timeout = () => ends({PATIENCE_MS});
}}"""


def opened_context(browser: Browser, **options: Any) -> BrowserContext:
    """A device, PHONE or LAPTOP with what else Playwright takes; its pages wait for a slow person."""
    expect.set_options(timeout=PATIENCE_MS)
    made = browser.new_context(**{"locale": "en-GB"} | options)
    made.set_default_timeout(PATIENCE_MS)
    made.add_init_script(_PATIENT)
    return made


def press(tab: Tab, where: str) -> bool:
    """By finger on a phone, by mouse on a laptop; whether *More* had to be opened for it first."""
    is_phone = tab.evaluate("matchMedia('(pointer: coarse)').matches")
    act = tab.tap if is_phone else tab.click
    is_behind = "[data-page" in where and tab.locator(where).is_hidden() and tab.locator("#more").is_visible()
    if is_behind:
        act("#more")
    act(where)
    return is_behind


def speak(tab: Tab, language: str) -> None:
    """From now on the page is in this language."""
    tab.evaluate("(language) => localStorage.setItem('language', language)", language)
    tab.reload()
    await_box(tab)


def await_box(tab: Tab) -> None:
    """Wait until the page shows a word of the box."""
    tab.wait_for_selector("#figures dt", state="attached")


# Notes in `seen` what the page's own classes hear and draw: the page itself ships nothing for tests.
_OBSERVED = """async () => {
  const [{ Box }, { Dance }] = await Promise.all([import("/box.js"), import("/dance.js")]);
  const seen = window.seen = { frames: 0, tick: 0, heard: 0, rings: null };
  const { draw, take } = Dance.prototype;
  Box.prototype.dispatchEvent = function (event) {
    if (event.type === "value") seen.heard = this.value.time;
    return EventTarget.prototype.dispatchEvent.call(this, event);
  };
  Dance.prototype.take = function (buffer) {
    const before = this.frame;
    take.call(this, buffer);
    if (this.frame !== before) seen.frames++;
  };
  Dance.prototype.draw = function () {
    draw.call(this);
    const { frame, show } = this;
    if (!frame || !show || frame.positions.length !== 3 * show.joints.length) return;
    seen.tick = frame.tick;
    seen.root = [...frame.positions.subarray(0, 3)];
    seen.puppets = frame.figures.length;
    seen.held = this.heldJoints().map((joint) => [show.joints[joint], frame.holds[joint]]);
    seen.ghost = frame.source && show.offsets ? [...this.ghost(frame).positions] : null;
    if (this.ring) seen.rings = this.joints.map((joint) => [show.joints[joint], ...this.ring(joint)]);
  };
}"""


def observe(tab: Tab) -> None:
    """From now on `seen` of the page has the newest frame that it drew, where its rings are, when it heard
    from the box, and the number of frames that came. A reload ends it.
    """
    tab.evaluate(_OBSERVED)


def open_part(tab: Tab, part: str) -> None:
    """Of the rehearsal: phrase, iterations, answer, hands and so on."""
    press(tab, f'#rehearsal-parts [data-opens="{part}"]')


def sensor_card(name: str) -> str:
    """The selector of a sensor's card."""
    return f'#cards article:has(h3:text-is("{name}"))'


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
    tab = context.new_page()
    tab.goto(page.origin)
    await_box(tab)
    observe(tab)
    unlock(tab, page)
    press(tab, f'[data-page="{which}"]')
    return tab


def declared(box: Box) -> ShowState:
    reader = ShowStateReader(box.runtime)
    found = reader.read()
    reader.close()
    return found
