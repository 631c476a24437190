"""The picture of the wall in a browser: the page's policy lets the JPEG inside the SVG through."""

from __future__ import annotations

from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser

from appliance.box.wall_file import ASKED, WALL
from tests.console.page import Page


def test_the_wall_is_seen_from_far_away(own_page: Page, browser: Browser, tmp_path: Path) -> None:
    """In the page and by itself: the page's policy lets the picture inside the SVG through."""
    runtime = own_page.box_file.parent / "runtime"
    Image.new("RGB", (480, 270), (200, 40, 10)).save(runtime / WALL)
    tab = browser.new_page(viewport={"width": 640, "height": 420})
    answer = tab.goto(f"{own_page.origin}/api/wall.jpg")
    assert answer is not None and answer.status == 200 and (runtime / ASKED).exists(), "it asks"
    tab.goto(f"{own_page.origin}/api/now.svg")
    for where in ("by itself", "in the page"):
        if where == "in the page":
            tab.goto(own_page.origin)
            tab.evaluate(
                "async () => { const img = new Image(); img.src = '/api/now.svg'; await img.decode();"
                " document.body.replaceChildren(img); }"
            )
        taken = tmp_path / "seen.png"
        tab.screenshot(path=taken)
        seen = Image.open(taken).convert("RGB")
        assert any(red > 150 and green < 90 for _, (red, green, _) in seen.getcolors(1 << 20) or ()), where
    tab.close()
