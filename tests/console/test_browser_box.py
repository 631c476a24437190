"""The page about the box in a browser."""

from __future__ import annotations

import re
import socket
from importlib.metadata import version

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from appliance.show.box import UdpConfig, load_box
from tests.console.browser import ON_A_LAPTOP, ON_BOTH, press, unlock
from tests.console.page import Page
from tests.system.box import Box

pytestmark = pytest.mark.realtime


def test_the_box_tells_its_release_and_addresses(tab: Tab, venue: tuple[Box, Page]) -> None:
    press(tab, '[data-page="box"]')
    expect(tab.locator("#box-release")).to_contain_text(version("bunraku"))
    expect(tab.locator("#box-release")).to_contain_text(venue[0].box_file.name)
    expect(tab.locator("#box-network")).to_contain_text(socket.gethostname())
    expect(tab.locator("#box-clock")).to_contain_text("Box clock: ")
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
    expect(dances).to_contain_text("<b>stick</b>starts at power-on · has not run here yet")
    expect(instead).to_contain_text("starts if the one above fails · has run here")
    expect(tab.locator("#box-refused li")).to_have_text(["show.yaml:3: no such key.", "It was too slow."])
    expect(tab.locator("#box-releases li")).to_have_text(["1.9", "2.0running"])
    expect(tab.locator("#box-rollback")).to_be_visible()
    expect(tab.locator("#box-network")).to_contain_text("192.0.2.7")


@ON_A_LAPTOP
def test_a_venue_changes_its_ports_and_a_mistake_has_its_line(tab: Tab, venue: tuple[Box, Page]) -> None:
    """The whole file is checked as `bunraku check` does; what was written before is kept beside it."""
    box, page = venue
    path = box.box_file
    before = path.read_text()
    unlock(tab, page)
    press(tab, '[data-page="box"]')
    press(tab, "#file-read")
    port = tab.locator('[name="sensors.udp.port"]')
    expect(port).not_to_have_value("")
    wanted = str(int(port.input_value()) - 1)
    port.fill("70000")
    press(tab, "#file-check")
    expect(tab.locator("#file-problems")).to_contain_text("'sensors.udp.port' is 70000, out of range")
    expect(port).to_have_attribute("aria-invalid", "true")
    expect(tab.locator("label:has([aria-invalid]) .wrong")).to_contain_text("Write 0 to 65535")
    assert path.read_text() == before
    port.fill(wanted)
    press(tab, "#file-check")
    expect(tab.locator("#file-said")).to_contain_text("counts from the next start")
    assert load_box(path).sensors.udp == UdpConfig(host="127.0.0.1", port=int(wanted))
    assert path.with_name("box.yaml.before").read_text() == before
    tab.locator("summary").focus()
    tab.keyboard.press("Enter")
    tab.fill("#file-text", "contrl: {port: 9002}\n" + before)
    press(tab, "#file-check")
    expect(tab.locator("#file-problems")).to_contain_text(
        "Line 1: Unknown key 'contrl'. Did you mean 'control'?"
    )
    tab.fill("#file-text", before)
    press(tab, "#file-check")
    expect(tab.locator("#file-said")).to_contain_text("counts from the next start")
    assert path.read_text() == before


@ON_BOTH
def test_the_last_lines_are_for_a_device_that_gave_the_pin(tab: Tab, venue: tuple[Box, Page]) -> None:
    _, page = venue
    assert page.get("/api/logs", Cookie="none").status == 401
    assert page.get("/api/box/file", Cookie="none").status == 401
    unlock(tab, page)
    press(tab, '[data-page="box"]')
    press(tab, "#logs-read")
    expect(tab.locator("#logs")).to_contain_text("The dance goes to")
    expect(tab.locator("#logs li", has_text=re.compile("Hz +tick"))).to_have_count(1)
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")
