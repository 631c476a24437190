"""A browser that loses its network, cancels a question, chooses a file again, or keeps nothing for pages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, expect
from playwright.sync_api import Page as Tab

from tests.console.browser import LAPTOP, await_box, await_true, opened_context, press, unlock
from tests.console.page import Page

pytestmark = pytest.mark.realtime

NO_PIN = "This needs the PIN. The box says it: bunraku console pin."
READY = {"can": True, "stick": [], "ready": None, "installing": False}


def opened(browser: Browser, page: Page, script: str = "", **options: Any) -> Iterator[Tab]:
    """A tab on a page without a stage."""
    context = opened_context(browser, **LAPTOP | options)
    tab = context.new_page()
    if script:
        tab.add_init_script(script)
    tab.goto(page.origin)
    await_box(tab)
    yield tab
    context.close()


@pytest.fixture
def tab(browser: Browser, page: Page) -> Iterator[Tab]:
    yield from opened(browser, page)


def test_a_question_for_the_pin_that_is_cancelled_is_an_answer(tab: Tab) -> None:
    """Else the button would say for ever that the file is being made."""
    press(tab, '[data-page="box"]')
    press(tab, "#help-make")
    expect(tab.locator("#pin")).to_be_visible()
    expect(tab.locator("#help-make")).to_be_disabled()
    press(tab, "#pin-cancel")
    expect(tab.locator("#help-make")).to_be_enabled()
    expect(tab.locator("#help-said")).to_have_text(NO_PIN)


def test_the_same_update_can_be_chosen_again_after_the_network_was_lost(
    tab: Tab, page: Page, tmp_path: Path
) -> None:
    package = tmp_path / "bunraku_1_arm64.deb"
    package.write_bytes(b"package")
    sent: list[str] = []
    tab.route("**/api/update", lambda route: route.fulfill(json=READY))
    tab.route("**/api/update/file*", lambda route: (sent.append(route.request.url), route.abort()))
    unlock(tab, page)
    press(tab, '[data-page="box"]')
    for times in (1, 2):
        tab.locator("#update-file").set_input_files(package)
        expect(tab.locator("#update-said")).to_contain_text("does not answer")
        assert len(sent) == times
        assert tab.evaluate("document.querySelector('#update-file').value") == "", "it would be no change"
        tab.evaluate("document.querySelector('#update-said').textContent = ''")


def test_a_choice_says_what_is_new_about_it_and_stays_the_same_button(tab: Tab) -> None:
    tab.evaluate(
        """async () => {
          const { showChoices } = await import("/choices.js"), part = document.createElement("div");
          const shown = (label) => showChoices(part, part, [{ name: "mine", label, now: false }], () => {});
          shown("1 file");
          const before = part.firstChild;
          shown("2 files");
          window.told = [part.firstChild === before, part.textContent];
        }"""
    )
    assert tab.evaluate("told") == [True, "2 files"]


def test_after_a_cue_that_was_called_again_go_calls_the_next(tab: Tab) -> None:
    """The cue in force is tapped, because the dancer begins anew; GO calls it, and must go on then."""
    said = tab.evaluate(
        """async () => {
          const { goOn, showCues } = await import("/cues.js"), own = window.fetch;
          window.fetch = async () => new Response('{"done": true, "message": ""}');
          const cues = ["calm", "storm", "end"].map((name) => ({ name, now: name === "calm" }));
          const button = () => document.querySelector("#go-name").textContent, said = [];
          showCues({ status: { cue: "calm" }, cues });
          said.push(button());
          document.querySelector("#cues button").click();
          said.push(button());
          await goOn();
          window.fetch = own;
          return [...said, button()];
        }"""
    )
    assert said == ["storm", "calm", "storm"]


def test_a_phone_whose_network_is_lost_without_a_word_asks_by_requests(tab: Tab) -> None:
    """Its WebSocket stays open for minutes, and nothing of it arrives."""
    readings: list[str] = []
    answer = {"lamp": "none", "linked": True, "said": ""}
    tab.route(
        "**/api/phones/reading",
        lambda route: (readings.append(route.request.url), route.fulfill(json=answer)),
    )
    tab.evaluate(
        """async () => {
          window.WebSocket = class extends EventTarget {
            static OPEN = 1;
            readyState = 1;
            bufferedAmount = 0;
            send() {}
            close() { window.isGone = true; }
          };
          const { PhoneLink } = await import("/phone_link.js");
          window.link = new PhoneLink("session");
          link.take([1, 2, 3]);
        }"""
    )
    assert not readings and not tab.evaluate("window.isGone ?? false")
    await_true(tab, "window.isGone === true && link.answers > 0 && !link.isSilent")
    assert readings
    tab.evaluate("link.close()")


def test_a_browser_that_keeps_nothing_for_pages_shows_the_page(browser: Browser, page: Page) -> None:
    refuses = """Object.defineProperty(window, "localStorage", {
      get() { throw new DOMException("The operation is insecure.", "SecurityError"); }
    })"""
    for tab in opened(browser, page, refuses, locale="de-DE"):
        expect(tab.locator("#verdict")).to_contain_text("läuft keine Show")


@pytest.mark.parametrize(
    ("path", "which", "button", "said"),
    [
        ("**/api/logs", "box", "#logs-read", "#logs-said"),
        ("**/api/prove", "prove", "", "#prove-said"),
    ],
)
def test_why_something_cannot_be_had_is_said_in_the_reader_s_language(
    browser: Browser, page: Page, path: str, which: str, button: str, said: str
) -> None:
    sentence = "Reading the log took too long. Try again."
    for tab in opened(browser, page, locale="de-DE"):
        tab.route(path, lambda route: route.fulfill(status=503, body=sentence))
        press(tab, f'[data-page="{which}"]')
        if button:
            press(tab, button)
        expect(tab.locator(said)).to_contain_text("Das Lesen des Protokolls dauerte zu lange.")
