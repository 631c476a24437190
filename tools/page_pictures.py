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
from playwright.sync_api import Browser, TimeoutError, sync_playwright

CHROMIUM = "/usr/bin/chromium"
PAGES = ("tonight", "dance", "sensors")
_FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
_COLOURS = 64  # a third of the bytes, and nothing that is seen
_WELL_WITHIN_MS = 20_000
_LINKED_S = 15.0  # the emulated sensor is on, its neutral pose taken, and no fallback of the start in force


def take_pictures(browser: Browser, address: str, folder: Path) -> list[Path]:
    """A PNG of each page as a phone shows it."""
    folder.mkdir(parents=True, exist_ok=True)
    taken = []
    tab = browser.new_page(viewport={"width": 390, "height": 844}, locale="en-GB")
    tab.goto(address)
    tab.wait_for_selector("body[data-heard]")
    with contextlib.suppress(TimeoutError):
        tab.wait_for_selector("body[data-level=well]", timeout=_WELL_WITHIN_MS)
    for page in PAGES:
        tab.click(f'[data-page="{page}"]')
        if page == "dance":
            tab.wait_for_selector("body[data-tick]")
        tab.wait_for_timeout(500)
        taken.append(folder / f"page-{page}.png")
        tab.screenshot(path=taken[-1])
        Image.open(taken[-1]).quantize(_COLOURS).save(taken[-1], optimize=True)
    tab.close()
    return taken


@contextlib.contextmanager
def _dancing() -> Iterator[str]:
    """The address of the page of a box that dances the show that comes with it, for no receiver."""
    with tempfile.TemporaryDirectory() as scratch:
        box = Path(scratch) / "box.yaml"
        box.write_text("outputs: {osc: []}\nconsole: {port: 0}\ncontrol: {port: 0}\nruntime: run\n")
        command = [sys.executable, "-m", "appliance.cli", "play", "--emulate", "--box", str(box)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                said = iter(process.stdout or ())
                address = next(found[1] for line in said if (found := re.search(r"page: (http\S+),", line)))
                time.sleep(_LINKED_S)
                yield address
            finally:
                process.terminate()


def main(
    address: Annotated[str | None, typer.Option(help="Of a page; left out: a box is started.")] = None,
    out: Annotated[Path, typer.Option(help="The folder.")] = _FOLDER,
) -> None:
    """Take the pictures of docs/technician.md."""
    box = contextlib.nullcontext(address) if address else _dancing()
    with box as found, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for path in take_pictures(browser, found, out):
            print(path)
        browser.close()


if __name__ == "__main__":
    typer.run(main)
