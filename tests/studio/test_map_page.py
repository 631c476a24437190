"""The page of `bunraku map` in a real browser without a network: it draws, turns, and walks along a path."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect, sync_playwright

from tests.studio.conftest import bunraku
from tools.page_pictures import CHROMIUM

# How many pixels of a canvas are near a colour.
COUNT = """([id, colour]) => {
  const canvas = document.getElementById(id), [width, height] = [canvas.width, canvas.height];
  const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
  let count = 0;
  for (let at = 0; at < pixels.length; at += 4)
    if (pixels[at + 3] > 60 && colour.every((value, part) => Math.abs(pixels[at + part] - value) < 25))
      count++;
  return count;
}"""
FIRST, SECOND, GHOST, DOTS = (226, 88, 62), (79, 179, 191), (125, 133, 144), (138, 133, 128)


@pytest.fixture(scope="module")
def page(pose_checkpoint: Path, recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """Opened from the disk, without a network; an error of its script fails the test."""
    out = tmp_path_factory.mktemp("map")
    files = [recordings / f"sway_{number}.bvh" for number in (0, 1)]
    result = bunraku("map", *files, "--model", pose_checkpoint, "--out", out)
    assert result.exit_code == 0, result.output
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        context = chromium.new_context(viewport={"width": 1000, "height": 600}, offline=True)
        tab, errors = context.new_page(), list[str]()
        tab.on("pageerror", lambda error: errors.append(str(error)))
        tab.on(
            "request", lambda request: None if request.url.startswith("file:") else errors.append(request.url)
        )
        tab.goto((out / "map.html").as_uri())
        expect(tab.locator("#clock")).not_to_be_empty()
        tab.click("#play")  # pauses
        yield tab
        chromium.close()
    assert errors == []


def test_paths_dots_and_both_figures_are_drawn(page: Page) -> None:
    for canvas, colour in (
        ("map", FIRST),
        ("map", SECOND),
        ("map", DOTS),
        ("figure", FIRST),
        ("figure", GHOST),
    ):
        assert page.evaluate(COUNT, [canvas, colour]) > 50, (canvas, colour)


@pytest.mark.parametrize("canvas", ["map", "figure"])
def test_it_turns_with_the_mouse_and_comes_nearer_with_the_wheel(page: Page, canvas: str) -> None:
    picture = f"document.getElementById('{canvas}').toDataURL()"
    before = page.evaluate(picture)
    box = page.locator(f"#{canvas}").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 90, box["y"] + box["height"] / 2 + 20)
    page.mouse.up()
    page.wait_for_function(f"before => {picture} != before", arg=before)
    turned = page.evaluate(picture)
    page.mouse.wheel(0, -300)
    page.wait_for_function(f"before => {picture} != before", arg=turned)


def test_the_moment_is_chosen_and_the_distance_there_is_told(page: Page) -> None:
    page.fill("#time", "25")
    expect(page.locator("#clock")).to_contain_text("1.0 s")
    text = page.locator("#clock").inner_text()
    source = page.evaluate("JSON.stringify(data.dances.map((dance) => dance.path[25]))")
    one, other = np.array(json.loads(source))
    assert text == f"1.0 s, {np.linalg.norm(one - other):.2f} apart"
    page.select_option("#which", "1")
    expect(page.locator("#clock")).to_contain_text("0.0 s")
    assert page.evaluate(COUNT, ["figure", SECOND]) > 50


def test_it_is_seen_in_perspective_from_above(page: Page) -> None:
    """x to the right, y up, z towards the eye: what is nearer is farther from the middle, and lower."""
    look = """([pitch, z]) => {
      [figure.yaw, figure.pitch, figure.zoom] = [0, pitch, 1];
      const [context, project] = figure.begin(), [x, y] = project([0.2, 0, z]);
      return [x - context.canvas.width / 2, y - context.canvas.height / 2];
    }"""
    (near, level), (far, _) = (page.evaluate(look, [0, z]) for z in (0.5, -0.5))
    assert near > 1.2 * far > 0 and level == pytest.approx(0)
    assert page.evaluate(look, [0.5, 0.5])[1] > 0 > page.evaluate(look, [0.5, -0.5])[1]
