"""Sensors paired by cable, renamed, replaced, revoked from a phone; the firmware is on a pseudo-terminal."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect
from playwright.sync_api import Page as Tab

from hw_sim.peers import free_ports
from tests.bundles import write_show
from tests.console.browser import PHONE, opened_context, press, sensor_card, unlocked_tab
from tests.console.page import Page, page_alone
from tests.system.bench import NETWORK, PASSWORD, Bench
from tests.system.box import playing
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime


def opened(browser: Browser, page: Page) -> Tab:
    return unlocked_tab(opened_context(browser, **PHONE), page, "sensors")


def begin(tab: Tab, done: bool = True) -> str:
    """Send the dialog, and what the box said until it was done."""
    press(tab, "#change-send")
    end = "done" if done else "failed"
    expect(tab.locator(f"#change-steps li.{end}")).to_be_visible()
    said = tab.inner_text("#change-steps")
    press(tab, "#change-cancel")
    return said


def state(tab: Tab, name: str, wanted: str) -> None:
    expect(tab.locator(sensor_card(name))).to_have_attribute("data-state", wanted)


def test_a_sensor_from_its_cable_to_its_end(browser: Browser, tmp_path: Path) -> None:
    (port,) = free_ports(1, socket.SOCK_STREAM)
    show = write_show(tmp_path / "show")
    with (
        playing(show, tmp_path, settings={"console": {"port": port}}) as box,
        Bench(box.sensors) as bench,
    ):
        page = Page(port, box.box_file)
        wait_until(page.is_open, lambda: box.output)
        tab = opened(browser, page)
        state(tab, "left-wrist", "absent")
        press(tab, "#pair")
        tab.fill("#change-name", "right-wrist")
        tab.fill("#change-port", "/dev/no-such-port")
        assert "There is no serial port /dev/no-such-port" in begin(tab, done=False)
        press(tab, "#pair")
        tab.fill("#change-name", "right-wrist")
        tab.fill("#change-port", bench.device)
        tab.fill("#change-network", NETWORK)
        tab.fill("#change-password", PASSWORD)
        said = begin(tab)
        assert "The running box took it" in said and PASSWORD not in said
        state(tab, "right-wrist", "linked")
        press(tab, sensor_card("right-wrist") + " summary")
        press(tab, sensor_card("right-wrist") + " >> text=Rename")
        tab.fill("#change-name", "spare")
        assert "right-wrist is now spare" in begin(tab)
        state(tab, "spare", "linked")
        press(tab, sensor_card("spare") + " >> text=Replace")  # by the sensor that the show wears
        expect(tab.locator("#change-spare option")).to_have_text("left-wrist (worn in this show)")
        expect(tab.locator("#change-anyway-words")).to_contain_text("left-wrist is worn in this show")
        expect(tab.locator("#change-send")).to_be_disabled()
        press(tab, "#change-cancel")
        press(tab, sensor_card("left-wrist") + " >> text=Replace")
        expect(tab.locator("#change-anyway-part")).to_be_hidden()
        assert "left-wrist is now the sensor that was spare" in begin(tab)
        state(tab, "left-wrist", "linked")
        press(tab, sensor_card("spare") + " summary")
        press(tab, sensor_card("spare") + " >> text=Revoke")
        assert "spare is revoked" in begin(tab)
        expect(tab.locator(sensor_card("spare"))).to_have_count(0)
        press(tab, sensor_card("left-wrist") + " summary")
        press(tab, sensor_card("left-wrist") + " >> text=Revoke")
        expect(tab.locator("#change-send")).to_be_disabled()
        press(tab, "#change-anyway")
        assert "left-wrist is revoked" in begin(tab)
        tab.context.close()
        box.end()


def test_changes_need_the_pin_and_are_bounded(tmp_path: Path) -> None:
    with page_alone(tmp_path) as (page, _):
        wanted = {"act": "revoke", "name": "left-wrist"}
        assert page.post("/api/sensors", wanted).status == 401
        page.unlock()
        for spoilt in (
            {"act": "burn", "name": "left-wrist"},
            {"act": "rename", "name": "left-wrist"},
            {"act": "rename", "name": "left-wrist", "new": "x" * 200},
            {"act": "pair", "name": "new", "port": "/etc/passwd"},
            {"act": "pair", "name": "new", "port": "/dev/../etc/passwd"},
            {"act": "revoke", "name": ["left-wrist"]},
        ):
            assert page.post("/api/sensors", spoilt).status == 400, spoilt
        answer = page.post("/api/sensors", {"act": "revoke", "name": "--help"})
        assert answer.status == 200 and answer.text.rstrip().endswith('{"done": false}')
