"""docs/pictures/page-*.png, by `python -m tools.page_pictures`: the page on a phone, taken by Chromium.

It starts a box with emulated sensors; `--address` takes the pictures from another one.
"""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
from PIL import Image
from playwright.sync_api import Browser, Page, TimeoutError, sync_playwright

CHROMIUM = "/usr/bin/chromium-headless-shell"  # without the windows of a desktop
PAGES = ("tonight", "dance", "sensors", "rehearsal", "picture", "prove", "happened", "box", "device")
PHONE = "sensors: {foreign: [{name: right-wrist, from: phone}]}\n"
_FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
_CAPTIONS = {"dance": "#held", "rehearsal": "#figure-said"}  # they say when a frame is drawn
_COLOURS = 64  # a third of the bytes, and nothing that is seen
_WELL_WITHIN_MS = 20_000
_FADED_MS, _PROVEN_WITHIN_MS = 4_000, 300_000
_LINKED_S = 15.0  # the emulated sensor is on, its neutral pose taken, and no fallback of the start in force


def take_pictures(
    browser: Browser, address: str, folder: Path, pin: str = "", well_within_ms: int = _WELL_WITHIN_MS
) -> list[Path]:
    """A PNG of each page as a phone shows it. pin: with it latency is proven first, for a picture of that.

    well_within_ms: a box that is not well by then is pictured as it is.
    """
    folder.mkdir(parents=True, exist_ok=True)
    taken = []
    tab = browser.new_page(viewport={"width": 390, "height": 844}, locale="en-GB")
    tab.goto(address)
    tab.wait_for_selector("#figures dt", state="attached")
    _await_well(tab, well_within_ms)
    if pin:
        _prove(tab, pin)
    for page in PAGES:
        tab.click(f'[data-page="{page}"]')
        if page in _CAPTIONS:
            tab.wait_for_selector(f'{_CAPTIONS[page]}:text-matches("Held|No hand")')  # a frame is drawn
        if page == "happened":
            tab.wait_for_selector("#happened-all:not([hidden])", timeout=_WELL_WITHIN_MS)
        if page == "box":
            tab.wait_for_selector("#box-all:not([hidden])", timeout=_WELL_WITHIN_MS)
        tab.wait_for_timeout(500)
        taken.append(folder / f"page-{page}.png")
        tab.screenshot(path=taken[-1])
        Image.open(taken[-1]).quantize(_COLOURS).save(taken[-1], optimize=True)
    tab.close()
    return taken


def take_phone(browser: Browser, address: str, folder: Path) -> Path:
    """A PNG of the page that makes a phone a sensor, before it begins."""
    tab = browser.new_page(viewport={"width": 390, "height": 640}, locale="en-GB")
    tab.goto(f"{address}/phone")
    tab.wait_for_selector("#begin:enabled")
    taken = folder / "page-phone.png"
    tab.screenshot(path=taken)
    tab.close()
    Image.open(taken).quantize(_COLOURS).save(taken, optimize=True)
    return taken


def _prove(tab: Page, pin: str) -> None:
    """Stop the show, measure for a moment, go on."""
    tab.click('[data-page="device"]')
    tab.click("#give-pin")
    tab.fill("#pin-input", pin)
    tab.click("#pin-send")
    tab.wait_for_selector("body[data-known=yes]")
    tab.click('[data-page="tonight"]')
    tab.click("#stop")
    tab.wait_for_timeout(_FADED_MS)
    tab.click('[data-page="prove"]')
    tab.select_option("#prove-seconds", "6")
    tab.click("#prove-begin")
    tab.wait_for_selector("#prove-document", timeout=_PROVEN_WITHIN_MS)
    tab.click('[data-page="tonight"]')
    tab.click("#resume")
    _await_well(tab)
    tab.wait_for_timeout(_FADED_MS)


def _await_well(tab: Page, within_ms: int = _WELL_WITHIN_MS) -> None:
    """A busy machine may not be well at all; then the pictures say so."""
    with contextlib.suppress(TimeoutError):
        tab.wait_for_selector("body[data-level=well]", timeout=within_ms)


@contextlib.contextmanager
def _dancing() -> Iterator[tuple[str, str]]:
    """Address and PIN of the page of a box that dances the show that comes with it, for no receiver."""
    with tempfile.TemporaryDirectory() as scratch:
        box = Path(scratch) / "box.yaml"
        box.write_text("outputs: {osc: []}\nconsole: {port: 0}\ncontrol: {port: 0}\nruntime: run\n" + PHONE)
        command = [sys.executable, "-m", "appliance.cli", "play", "--emulate", "--box", str(box)]
        command += ["--journal", f"{scratch}/night"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                said = iter(process.stdout or ())
                said_at = (re.search(r"page: (http\S+), PIN (\d+)", line) for line in said)
                address, pin = next(found.groups() for found in said_at if found)
                time.sleep(_LINKED_S)
                yield address, pin
            finally:
                process.terminate()


def main(
    address: Annotated[str | None, typer.Option(help="Of a page; left out: a box is started.")] = None,
    out: Annotated[Path, typer.Option(help="The folder.")] = _FOLDER,
) -> None:
    """Take the pictures of docs/page.md."""
    box = contextlib.nullcontext((address, "")) if address else _dancing()
    with box as (found, pin), sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for path in take_pictures(browser, found, out, pin):
            print(path)
        print(take_phone(browser, found, out))
        browser.close()


if __name__ == "__main__":
    typer.run(main)
