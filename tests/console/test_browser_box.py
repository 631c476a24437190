"""The page about the box in a browser."""

from __future__ import annotations

import re
import socket
import time
import zipfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from appliance.box.fallback import Fallbacks
from appliance.box.process_health import ProcessHealthWriter
from appliance.remote.fallback import OF_THE_REMOTE
from appliance.show.box import UdpConfig, load_box
from appliance.show_control.midi_bindings import Binding, MidiBindings
from tests.console.browser import ON_A_LAPTOP, ON_BOTH, PATIENCE_MS, press, unlock
from tests.console.page import Page
from tests.system.box import Box

pytestmark = pytest.mark.realtime


def test_the_box_tells_its_release_and_addresses(tab: Tab, venue: tuple[Box, Page]) -> None:
    press(tab, '[data-page="box"]')
    expect(tab.locator("#box-release")).to_contain_text(version("bunraku"))
    expect(tab.locator("#box-release")).to_contain_text(venue[0].box_file.name)
    expect(tab.locator("#box-network")).to_contain_text(socket.gethostname())
    as_people_read_it = re.compile(r"Box clock: \d+ \w+ \d{4} at \d\d:\d\d:\d\d$")
    expect(tab.locator("#box-clock")).to_have_text(as_people_read_it)
    expect(tab.locator("#box-shows-part")).to_be_hidden()


def test_the_box_tells_which_shows_it_has(tab: Tab) -> None:
    """As an installed box answers, with names that no page may take for its own text."""
    reported = {
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
    tab.route("**/api/box", lambda route: route.fulfill(json=reported))
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
    tab.locator("#file-whole summary").focus()
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
    others = f"{before}# by another device\n"
    path.write_text(others)
    press(tab, "#file-check")
    expect(tab.locator("#file-problems")).to_contain_text("Another device has changed the box file")
    assert path.read_text() == others
    path.write_text(before)


def test_what_differs_from_the_file_is_marked_and_a_mistake_in_a_folded_part_is_shown(
    tab: Tab, venue: tuple[Box, Page]
) -> None:
    unlock(tab, venue[1])
    press(tab, '[data-page="box"]')
    press(tab, "#file-read")
    port, group = tab.locator('[name="console.port"]'), tab.locator('details:has([name="console.port"])')
    expect(port).to_be_hidden()
    group.locator("summary").tap()
    before = port.input_value()
    help_of_it = tab.locator('.venue-field:has([name="console.port"]) .help')
    help_of_it.tap()
    expect(tab.locator('.venue-field:has([name="console.port"]) > small')).to_contain_text("console.port")
    port.fill("70000")
    expect(tab.locator("label:has([name='console.port'])")).to_contain_text(f"was {before}")
    expect(group.locator("summary")).to_have_text("This page Changed: 1")
    group.locator("summary").tap()
    tab.evaluate("scrollTo(0, document.querySelector('#file-part').offsetTop)")
    assert tab.evaluate(IN_REACH, "#file-check"), (
        "the button that saves is in reach from anywhere in the form"
    )
    press(tab, "#file-check")
    expect(port).to_be_visible()
    expect(port).to_have_attribute("aria-invalid", "true")
    expect(tab.locator("label:has([aria-invalid])")).to_contain_text("out of range")
    port.fill(before)
    expect(tab.locator("#file-changes")).to_be_hidden()


# Whether a tap on the middle of an element meets it.
IN_REACH = """(selector) => {
  const one = document.querySelector(selector), at = one.getBoundingClientRect();
  return document.elementFromPoint(at.x + at.width / 2, at.y + at.height / 2) === one;
}"""


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


@ON_BOTH
def test_a_receiver_is_added_and_removed_and_comments_elsewhere_stay(
    tab: Tab, venue: tuple[Box, Page]
) -> None:
    box, page = venue
    path = box.box_file
    before = path.read_text()
    path.write_text(f"# the box of this venue\n{before}")
    unlock(tab, page)
    press(tab, '[data-page="box"]')
    try:
        press(tab, "#file-read")
        fields = tab.locator("#file-receivers fieldset")
        expect(tab.locator("#file-add")).to_be_visible()
        count = fields.count()
        press(tab, "#file-add")
        expect(fields).to_have_count(count + 1)
        host, port = (fields.nth(count).locator("input").nth(place) for place in (0, 1))
        host.fill("300.0.0.1")
        port.fill("9123")
        press(tab, "#file-check")
        expect(host).to_have_attribute("aria-invalid", "true")
        expect(tab.locator("#file-problems")).to_contain_text("is not an IPv4 address")
        host.fill("192.168.0.20")
        press(tab, "#file-check")
        expect(tab.locator("#file-said")).to_contain_text("counts from the next start")
        receivers = load_box(path).outputs.osc
        assert (receivers[-1].host, receivers[-1].port, len(receivers)) == ("192.168.0.20", 9123, count + 1)
        assert path.read_text().startswith("# the box of this venue\n")
        press(tab, f"#file-receivers fieldset:nth-child({count + 1}) button")
        expect(fields.nth(count)).to_contain_text("Removed when saved")
        press(tab, "#file-check")
        expect(tab.locator("#file-said")).to_contain_text("counts from the next start")
        assert len(load_box(path).outputs.osc) == count
    finally:
        path.write_text(before)


@ON_A_LAPTOP
def test_one_button_makes_one_file_for_somebody_who_can_help(tab: Tab, venue: tuple[Box, Page]) -> None:
    _, page = venue
    assert page.get("/api/help.zip", Cookie="none").status == 401
    assert page.post("/api/help", {"journal": True}, Cookie="none").status == 401
    unlock(tab, page)
    press(tab, '[data-page="box"]')
    with tab.expect_download(timeout=5 * PATIENCE_MS) as download:
        press(tab, "#help-make")
    expect(tab.locator("#help-said")).to_contain_text(download.value.suggested_filename)
    with zipfile.ZipFile(download.value.path()) as whole:
        parts = {name: whole.read(name) for name in whole.namelist()}
    assert "journal.bunraku" in parts, parts["README.txt"].decode()
    assert b"stage" in parts["doctor.txt"] and b"The dance goes to" in parts["log.txt"]
    assert not [name for name, content in parts.items() if page.pin.encode() in content]


def test_a_picture_of_now_is_drawn_for_somebody_far_away(tab: Tab, venue: tuple[Box, Page]) -> None:
    _, page = venue
    answer = page.get("/api/now.svg")
    assert answer.status == 200 and answer.headers["Content-Type"].startswith("image/svg+xml")
    assert answer.text.count("<path") > 4, "a figure"
    assert page.get("/api/night").status == 200
    assert [page.get(f"/api/night/{name}.svg").status for name in ("7", "..", "%2e%2e")] == [404, 404, 404]
    drawn = """() => new Promise((over) => {
      const picture = new Image();
      picture.onload = () => over(picture.naturalWidth > 0);
      picture.onerror = () => over(false);
      picture.src = "/api/now.svg";
    })"""
    assert tab.evaluate(drawn)


FADER = {"device": "nanoKONTROL", "kind": "controller", "channel": 1, "number": 7, "value": 0.5}
HOURS = {"open": True, "next": "tue 18:00", "projectors": [{"host": "10.0.0.4", "state": "warming"}]}


@pytest.fixture
def bindings(venue: tuple[Box, Page], tmp_path: Path) -> Iterator[MidiBindings]:
    health = ProcessHealthWriter(venue[0].runtime, "remote", Fallbacks(OF_THE_REMOTE))
    reported: dict[str, Any] = {"timecode": "01:00:10:05", "state": "freewheeling", "hours": HOURS}
    health.reported = reported | {"midi": ["nanoKONTROL"], "bindings": str(tmp_path / "kept"), "moved": FADER}
    health.publish_health(time.monotonic())
    yield MidiBindings(tmp_path / "kept")
    health.end(time.monotonic())
    health.close()


def test_a_fader_is_moved_and_bound_and_forgotten(
    tab: Tab, venue: tuple[Box, Page], bindings: MidiBindings
) -> None:
    expect(tab.locator("#figures")).to_contain_text("01:00:10:05 · freewheeling")
    expect(tab.locator("#figures")).to_contain_text("open until Tue 18:00")
    expect(tab.locator("#figures")).to_contain_text("warming up")
    unlock(tab, venue[1])
    press(tab, '[data-page="box"]')
    expect(tab.locator("#midi-moved")).to_have_text("nanoKONTROL: controller 7, channel 1")
    expect(tab.locator("#midi-command option")).not_to_have_count(0)
    tab.select_option("#midi-command", "/master")
    tab.fill("#midi-high", "0.8")
    press(tab, "#midi-bind")
    expect(tab.locator("#midi-bindings li")).to_contain_text(["controller 7, channel 1: /master"])
    assert bindings.all == (Binding("nanoKONTROL", "controller", 1, 7, "/master", "", 0.0, 0.8),)
    tab.select_option("#midi-command", "/cue")
    tab.select_option("#midi-name", index=1)
    press(tab, "#midi-bind")
    expect(tab.locator("#midi-bindings li")).to_contain_text(["/cue"])
    assert [one.address for one in bindings.all] == ["/cue"]
    press(tab, "#midi-bindings button")
    expect(tab.locator("#midi-bindings li")).to_have_count(0)
    assert bindings.all == ()
