"""What went wrong is told by the name of the thing that it is about, in the reader's language."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from hw_sim.peers import free_ports
from tests.bundles import write_show
from tests.console.browser import PATIENCE_MS, PHONE
from tests.console.page import Page
from tests.system.box import playing
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime


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
        context = browser.new_context(**PHONE, locale=locale)
        context.set_default_timeout(PATIENCE_MS)
        tab = context.new_page()
        tab.goto(page.origin)
        reported = tab.locator("#fallbacks-now li", has_text=message)
        expect(reported).to_contain_text(f"127.0.0.1:{nobody}", timeout=PATIENCE_MS)
        context.close()
