"""MIDI bindings, timecode and opening hours in a browser, with the report of the process that hears them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from appliance.box.fallback import Fallbacks
from appliance.box.process_health import ProcessHealthWriter
from appliance.remote.fallback import OF_THE_REMOTE
from appliance.show_control.midi_bindings import Binding, MidiBindings
from tests.console.browser import press, unlock
from tests.console.page import Page
from tests.system.box import Box

pytestmark = pytest.mark.realtime

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
