"""A venue without any network but the cable between the box and a phone."""

from __future__ import annotations

import contextlib
import socket
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

from tests.bundles import write_show
from tests.console.browser import PATIENCE_MS, PHONE, await_box, await_true, observe, press
from tests.console.page import box_with_page
from tests.system.namespace import Cable, Namespace, why_not
from tools.page_pictures import CHROMIUM

WHY_NOT = why_not()
BOX, SUBNET = "10.77.0.1", "10.77.0.0/24"

pytestmark = [pytest.mark.realtime, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]


def test_without_any_other_network_every_page_opens_and_the_figure_dances(tmp_path: Path) -> None:
    """Neither the page nor the box asks for anything that lies elsewhere."""
    console = {"host": "0.0.0.0", "viewers": [SUBNET]}
    with Namespace("box") as stage, Namespace("phone") as hand:
        Cable(stage, f"{BOX}/24", hand, "10.77.0.2/24")
        show = write_show(tmp_path / "show")
        with stage.entered(), box_with_page(show, tmp_path, settings={"console": console}) as (_, page):
            before, own = without_route(), f"//{BOX}:{page.port}/"
            with hand.entered(), sync_playwright() as playwright:
                chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
                tab = chromium.new_page(**PHONE)
                tab.set_default_timeout(PATIENCE_MS)
                asked: list[str] = []
                tab.on("request", lambda request: asked.append(request.url))
                tab.on("websocket", lambda one: asked.append(one.url))
                tab.goto(f"http:{own}")
                await_box(tab)
                observe(tab)
                pages = tab.locator("[data-page]:not([hidden])")
                names = [str(one.get_attribute("data-page")) for one in pages.all()]
                assert len(names) >= 8
                for name in (*names, "dance"):
                    press(tab, f'[data-page="{name}"]')
                await_true(tab, "seen.tick > 0")
                tick = int(tab.evaluate("seen.tick"))
                await_true(tab, f"seen.tick > {tick + 20}")
                chromium.close()
            assert {own in url for url in asked} == {True}, asked
            assert without_route() == before, "the box sent something that had no way out"
            with socket.socket() as one, contextlib.suppress(OSError):
                one.connect(("192.0.2.1", 80))
            assert without_route() > before, "and that would have been counted"


def without_route() -> int:
    """Packets and connections of this network that had no way to where they should go."""
    lines = Path("/proc/thread-self/net/snmp").read_text().splitlines()
    names, values = (line.split() for line in lines if line.startswith("Ip:"))
    return int(values[names.index("OutNoRoutes")])
