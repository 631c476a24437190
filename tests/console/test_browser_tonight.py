"""Tonight in a browser: nothing moves or is covered when something goes wrong; taps for a task."""

from __future__ import annotations

import socket
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, expect
from playwright.sync_api import Page as Tab

from hw_sim.peers import free_ports
from tests.bundles import write_show
from tests.console.browser import (
    ON_BOTH,
    PHONE,
    await_box,
    await_true,
    declared,
    opened_context,
    press,
    speak,
    unlock,
)
from tests.console.page import Page
from tests.console.test_browser_picture import drag
from tests.stage.test_fallbacks import EVERY
from tests.system.box import Box, playing
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime

CONTROLS = ("go", "stop", "resume", "master", "slot", "cues-part", "blackout", "panic", "verdict", "now")

# From now on the page hears what the box says with these fallbacks in place of its own.
HEARD_WITH = """async () => {
  const { Box } = await import("/box.js"), hear = Box.prototype.hear;
  window.fallbacks = [];
  window.heard = 0;
  Box.prototype.hear = function (value) {
    value.fallbacks = window.fallbacks;
    const active = window.fallbacks.find((one) => one.active);
    value.verdict = active
      ? { level: "warning", key: "fallbacks", values: { heard: 1, worn: 2, message: active.message } }
      : { level: "well", key: "well", values: { heard: 2, worn: 2, rate: 50, since: value.since } };
    hear.call(this, value);
    window.heard++;
  };
}"""
SHOULDER = {"en": "left shoulder", "de": "linke Schulter", "fr": "épaule gauche"}  # lShldr
PLACES = """(ids) => ids.map((id) => {
  const { x, y, width, height } = document.getElementById(id).getBoundingClientRect();
  return [id, x, y, width, height];
})"""


def say(tab: Tab, fallbacks: list[dict[str, Any]]) -> None:
    """Wait until the page shows these."""
    tab.evaluate("(said) => { window.fallbacks = said; window.heard = 0; }", fallbacks)
    await_true(tab, "window.heard > 0")


def fell(name: str, about: str = "") -> dict[str, Any]:
    row = EVERY[name]
    message = row.named.format(about=about) if about and row.named else row.message
    return {"name": name, "times": 3, "active": True, "message": message, "about": about, "process": "stage"}


@ON_BOTH
@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_nothing_moves_when_fallbacks_come_and_go(tab: Tab, language: str) -> None:
    """Whatever the sentence is, and however many are in force, each control stays in its place."""
    speak(tab, language)
    tab.evaluate(HEARD_WITH)
    say(tab, [])
    expect(tab.locator("#slot-hands li")).to_contain_text([SHOULDER[language]])
    before = tab.evaluate(PLACES, CONTROLS)
    assert all(width > 0 and height > 0 for _, _, _, width, height in before), before
    longest = max(EVERY, key=lambda name: len(EVERY[name].message))
    several = [fell("sensor-silent", "left-wrist, right-wrist"), fell("receiver-gone", "10.0.0.9:9004 (vmc)")]
    for said in (
        [fell(longest)],
        several,
        [fell(name) for name in EVERY],
        [{**fell(longest), "active": False}],
        [],
    ):
        say(tab, said)
        assert tab.evaluate(PLACES, CONTROLS) == before
    say(tab, several)
    expect(tab.locator("#slot-hands")).to_be_hidden()
    for about in ("left-wrist", "10.0.0.9:9004"):
        expect(tab.locator("#fallbacks-now")).to_contain_text(about)
    say(tab, [{**fell("pair-taken"), "message": "Look; `bunraku pair back` gives the lead."}])
    expect(tab.locator("#fallbacks-now")).to_contain_text("bunraku pair back")
    expect(tab.locator("#fallbacks-now")).not_to_contain_text("`")


# From now on the box says that the second cue was called `ago` seconds ago, with a fade of ten.
CALLED = """async () => {
  window.ago = 5;
  const { Box } = await import("/box.js"), hear = Box.prototype.hear, get = fetch;
  const cues = [{ name: "calm" }, { name: "storm", fade_s: 10 }, { name: "end", at: "01:00:30:00" }];
  window.fetch = async (path, ...more) => path !== "/api/show" ? get(path, ...more)
    : new Response(JSON.stringify({ ...await (await get(path)).json(), cues }));
  Box.prototype.hear = function (value) {
    value.cue_since = value.time - window.ago;
    value.fade = window.ago < 10 ? [value.cue_since, 10] : null;
    value.generation += 1000;
    value.cues = cues.map(({ name }) => ({ name, now: name === "storm" }));
    value.status = { ...value.status, cue: "storm" };
    value.remote = { state: "running", timecode: "01:00:10:00" };
    hear.call(this, value);
  };
}"""
PROGRESS = """() => {
  const cue = (state) => document.querySelector(`#cues [aria-${state}="true"]`);
  const fade = document.querySelector("#fade");
  return {
    runs: fade.classList.contains("runs"), fade: fade.value,
    share: Number(cue("current")?.style.getPropertyValue("--share") ?? -1),
    since: document.querySelector("#now-since").textContent, next: cue("pressed")?.textContent ?? "",
  };
}"""


@ON_BOTH
def test_the_cue_in_force_shows_how_far_its_fade_is(tab: Tab) -> None:
    """Since when it is in force, and when the timecode calls the next one; and nothing moves by it."""
    tab.evaluate(CALLED)
    await_true(tab, f"({PROGRESS})().share >= 0.5 && ({PROGRESS})().next.includes('in 0:20')")
    running = tab.evaluate(PROGRESS)
    assert running["runs"] and 0.5 <= running["fade"] < 1 and running["since"].startswith("0:0")
    places = tab.evaluate(PLACES, CONTROLS)
    tab.evaluate("window.ago = 70")
    await_true(tab, f"!({PROGRESS})().runs && ({PROGRESS})().since === '1:10'")
    assert tab.evaluate(PROGRESS)["share"] == 0
    assert tab.evaluate(PLACES, CONTROLS) == places


@ON_BOTH
def test_an_answer_of_the_box_covers_nothing_that_is_touched(tab: Tab, venue: tuple[Box, Page]) -> None:
    unlock(tab, venue[1])
    press(tab, '[data-page="tonight"]')
    before = tab.evaluate(PLACES, CONTROLS)
    covered = """() => {
      const answer = document.getElementById('said'), said = answer.getBoundingClientRect();
      if (answer.textContent === '') return null;
      return [...document.querySelectorAll('footer button, nav button, dialog[open] button')]
        .filter((one) => {
          const box = one.getBoundingClientRect();
          return box.x < said.right && said.x < box.right && box.y < said.bottom && said.y < box.bottom;
        }).map((one) => one.id);
    }"""

    def found() -> tuple[Any, Any] | None:
        """What the answer covers, and where all is, while it is shown: it goes after three seconds."""
        covers, places = tab.evaluate(f"(ids) => [({covered})(), ({PLACES})(ids)]", CONTROLS)
        return None if covers is None else (covers, places)

    press(tab, "#resume")
    seen = wait_until(found, "no answer was shown", lambda: press(tab, "#resume"))
    assert seen == ([], before)
    tab.evaluate("scrollTo(0, document.body.scrollHeight)")
    last = tab.locator("#tonight").bounding_box()
    footer = tab.locator("footer").bounding_box()
    assert last is not None and footer is not None
    assert last["y"] + last["height"] <= footer["y"] + 1, (
        "the end of the page can be scrolled above the buttons"
    )


@ON_BOTH
def test_panic_is_in_reach_while_the_pin_is_asked_for(tab: Tab, venue: tuple[Box, Page]) -> None:
    box, page = venue
    press(tab, "#stop")
    expect(tab.locator("#pin")).to_be_visible()
    press(tab, "#panic")
    expect(tab.locator("#pin-said")).to_contain_text("PANIC follows")
    tab.fill("#pin-input", page.pin)
    press(tab, "#pin-send")
    wait_until(lambda: declared(box).panic, "PANIC was lost behind the question")
    assert declared(box).going, "the first request gave way to it"
    press(tab, "#stop")
    wait_until(lambda: not declared(box).going)
    press(tab, "#resume")
    wait_until(lambda: declared(box).going and not declared(box).panic)


# From now on the page hears that show control was silent when it was asked last.
SILENT = """async () => {
  const { Box } = await import("/box.js"), hear = Box.prototype.hear;
  Box.prototype.hear = function (value) {
    value.trouble = "Show control does not answer. What is in force stays in force; try again.";
    hear.call(this, value);
    window.heard = true;
  };
}"""


def test_no_command_is_held_back_while_show_control_starts_again(tab: Tab, venue: tuple[Box, Page]) -> None:
    """What comes meanwhile waits in its port, and is done."""
    box, page = venue
    unlock(tab, page)
    press(tab, '[data-page="tonight"]')
    tab.evaluate(SILENT)
    await_true(tab, "window.heard === true")
    press(tab, "#stop")
    wait_until(lambda: not declared(box).going, "STOP was held back")
    press(tab, "#resume")
    wait_until(lambda: declared(box).going, "RESUME was held back")


class Taps:
    """Presses as a person would, and counts them."""

    def __init__(self, tab: Tab) -> None:
        self.tab, self.count = tab, 0

    def press(self, where: str) -> None:
        self.count += 1 + press(self.tab, where)


MOST_TAPS = 3


@ON_BOTH
def test_each_task_takes_three_taps_at_most(context: BrowserContext, venue: tuple[Box, Page]) -> None:
    """From Tonight, on a device that gave the PIN. Typing a name and dragging a corner are no taps."""
    _, page = venue
    tab = context.new_page()
    tab.goto(page.origin)
    await_box(tab)
    unlock(tab, page)
    asked: list[tuple[str, Any]] = []
    for path in ("sensors", "prove", "command"):
        tab.route(f"**/api/{path}", lambda route: _answered(route, asked))
    wearing = f"async () => {{ {WEARABLES} }}"
    tab.evaluate(wearing)
    await_true(tab, "window.heard > 0")
    for begin in (_pair, _replace, _measure, _corner):
        press(tab, '[data-page="tonight"]')
        asked.clear()
        taps = Taps(tab)
        begin(taps)
        name = begin.__name__
        heard = partial(_is_asked, ASKED[name], asked)
        # Requests are answered inside of playwright's calls only.
        wait_until(heard, partial(_said, name, tab, asked), lambda: tab.wait_for_timeout(20))
        is_far = name == "_measure" and tab.locator("#more").is_visible()  # it is no task of a show
        assert taps.count <= MOST_TAPS + is_far, f"{name} takes {taps.count} taps"
        if tab.locator("#change").is_visible():
            press(tab, "#change-cancel")


# In the request that a task ends with.
ASKED = {
    "_pair": "/api/sensors",
    "_replace": "spare-1",
    "_measure": "/api/prove",
    "_corner": "/projector/nudge",
}
# A worn sensor and a spare, of a show that plays real sensors.
WEARABLES = """
  const { Box } = await import("/box.js"), hear = Box.prototype.hear, get = fetch;
  window.heard = 0;
  window.fetch = async (path, ...more) => path !== "/api/show" ? get(path, ...more)
    : new Response(JSON.stringify({ ...await (await get(path)).json(), rehearsal: null }));
  Box.prototype.hear = function (value) {
    const [worn] = value.sensors;
    value.sensors = [worn, { ...worn, name: "spare-1", is_worn: false, neutral: "" }];
    value.generation += 1000;
    value.processes.push({ process: "projector", late: false });
    const corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
    value.wall = { corners, brightness: 1, grid: false, test_card: false, info: false };
    hear.call(this, value);
    window.heard++;
  };
"""


def _is_asked(wanted: str, asked: list[tuple[str, Any]]) -> bool:
    return any(wanted in str(one) for one in asked)


def _said(name: str, tab: Tab, asked: list[tuple[str, Any]]) -> str:
    return f"{name}: the box hears {asked}; {tab.inner_text('#said')} {tab.inner_text('#change')}"


def _answered(route: Any, asked: list[tuple[str, Any]]) -> None:
    if route.request.method != "POST":
        goes = not _is_asked("/stop", asked)
        route.fulfill(json={"runs": None, "show_goes": goes, "proofs": []})
        return
    asked.append((route.request.url, route.request.post_data_json))
    route.fulfill(body='{"done": true, "message": "Done."}\n')


def _pair(taps: Taps) -> None:
    taps.press('[data-page="sensors"]')
    taps.press("#pair")
    taps.tab.fill("#change-name", "right-wrist")
    taps.press("#change-send")


def _replace(taps: Taps) -> None:
    taps.press('[data-page="sensors"]')
    taps.press("#cards article:first-child >> text=Replace")
    assert taps.tab.locator("#change-spare").input_value() == "spare-1"
    taps.press("#change-send")


def _measure(taps: Taps) -> None:
    """While the show goes, the button asks once more, in its own place."""
    taps.press('[data-page="prove"]')
    begin = taps.tab.locator("#prove-begin")
    expect(begin).to_have_text("Stop the show and measure: 30 seconds")
    taps.press("#prove-begin")
    expect(begin).to_have_text("Sure? The show stops")
    taps.press("#prove-begin")


def _corner(taps: Taps) -> None:
    taps.press('[data-page="picture"]')
    taps.press('[data-part="wall"]')
    box = taps.tab.locator("#corners button").nth(0).bounding_box()
    assert box is not None
    drag(taps.tab, box["x"] + 30, box["y"] + 30, 20, 20)
    taps.count += 1


@pytest.mark.parametrize(
    ("locale", "message"), [("de-DE", "bekommt den Tanz nicht"), ("en-GB", "does not get the dance")]
)
def test_a_dead_receiver_has_its_name_in_each_language(
    browser: Browser, tmp_path: Path, locale: str, message: str
) -> None:
    (port,), (nobody,) = free_ports(1, socket.SOCK_STREAM), free_ports(1)
    settings = {"console": {"port": port}, "outputs": {"osc": [{"port": nobody}]}}
    with playing(write_show(tmp_path / "show"), tmp_path, settings=settings) as box:
        page = Page(port, box.box_file)
        wait_until(page.is_open, lambda: box.output)
        context = opened_context(browser, **PHONE, locale=locale)
        tab = context.new_page()
        tab.goto(page.origin)
        reported = tab.locator("#fallbacks-now li", has_text=message)
        expect(reported).to_contain_text(f"127.0.0.1:{nobody}")
        context.close()
