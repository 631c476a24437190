"""Picture and light in a browser: corners that are dragged move on the wall, lamps shine and are walked."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import yaml
from playwright.sync_api import BrowserContext, expect
from playwright.sync_api import Page as Tab
from playwright.sync_api import TimeoutError as PlaywrightTimeoutError

from appliance.levers.table import LOOK
from appliance.show.look import STYLES
from tests.bundles import write_show
from tests.console.browser import ON_BOTH, await_box, await_true, declared, press, unlocked_tab
from tests.console.page import Page, box_with_page
from tests.system.box import Box
from tests.system.lit import DIMMER, PAR, RIG, Node, artnet, node
from tests.system.processes import wait_until
from tests.system.test_projector import Projection

pytestmark = pytest.mark.realtime

RED = PAR + 1
WALL_PART, RIG_PART = '[data-part="wall"]', '[data-part="rig"]'
TRIES_FOR_S = 15.0  # after a drag the page tries its last step three times


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Box, Page, Node]]:
    """A box with a rig, whose levels arrive at a node."""
    folder = tmp_path_factory.mktemp("hall")
    show = write_show(folder / "show", lights=RIG)
    with (
        node() as (lamps, port),
        box_with_page(show, folder, settings=artnet(port, 1, 2), has_sensors=False) as (box, page),
    ):
        yield box, page, lamps


@pytest.fixture(scope="module")
def wall(hall: tuple[Box, Page, Node], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Projection]:
    """The projector beside that box."""
    with Projection(hall[0].box_file, tmp_path_factory.mktemp("wall")) as projection:
        projection.await_dance()
        yield projection
        projection.end()


def test_the_rig_shines_on_the_page_and_is_walked_while_the_show_stands(
    context: BrowserContext, hall: tuple[Box, Page, Node]
) -> None:
    box, page, lamps = hall
    tab = unlocked_tab(context, page, "picture")
    press(tab, RIG_PART)
    tab.evaluate(WALKED)
    expect(tab.locator("#lamps button")).to_have_text(["head · 100 %", "par · 100 %", "second · 100 %"])
    await_true(tab, f"({LIT})() > 200")
    press(tab, "#rig-walk")
    expect(tab.locator("#said")).to_contain_text("Stop it first")
    press(tab, '[data-page="tonight"]')
    press(tab, "#stop")
    wait_until(lambda: not declared(box).going)
    press(tab, '[data-page="picture"]')
    expect(tab.locator("#lamps button").nth(0)).to_have_text("head · 0 %")

    def begins() -> bool:
        press(tab, "#lamps >> text=par")
        return "par: " in tab.inner_text("#rig-said")

    wait_until(begins, lambda: tab.inner_text("#said"))
    lamps.await_levels(lambda levels: levels[PAR] == 255 and levels[DIMMER] == 0)
    await_true(tab, "walked.some((said) => said.includes('Now par: red'))")
    lamps.await_levels(lambda levels: levels[RED] == 255 and not any(levels[RED + 1 : RED + 4]))

    def is_ended() -> bool:
        """Pressed while it walks: a busy machine finds it at its own end."""
        begins()
        with contextlib.suppress(PlaywrightTimeoutError):
            tab.locator("#rig-end").click(timeout=5000)
            return True
        return False

    wait_until(is_ended)
    lamps.await_safe()
    expect(tab.locator("#rig-said")).to_be_empty()
    press(tab, "#lamps >> text=par")
    lamps.await_levels(lambda levels: levels[PAR] > 200)
    press(tab, "#panic")
    lamps.await_safe()
    press(tab, '[data-page="tonight"]')
    press(tab, "#resume")
    lamps.await_dance()
    press(tab, '[data-page="picture"]')
    expect(tab.locator("#rig-walk")).to_be_visible()
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")


# What the page says of a walk, from now on: a colour is up for a second.
WALKED = """() => {
  const said = document.querySelector('#rig-said');
  window.walked = [];
  new MutationObserver(() => walked.push(said.textContent)).observe(said, { childList: true });
}"""
# The brightest pixel of the picture of the rig.
LIT = """() => {
  const canvas = document.querySelector('#rig');
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  return data.reduce((most, one, place) => place % 4 === 3 ? most : Math.max(most, one), 0);
}"""


def test_a_look_is_chosen_by_its_picture(context: BrowserContext, hall: tuple[Box, Page, Node]) -> None:
    """Each look has the picture of its style; one that does not load has no width."""
    box, page, _ = hall
    tab = unlocked_tab(context, page, "picture")
    pictures = tab.locator("#looks img")
    expect(pictures).to_have_count(len(STYLES))
    await_true(tab, "[...document.querySelectorAll('#looks img')].every((one) => one.naturalWidth > 100)")
    assert len({one.get_attribute("src") for one in pictures.all()}) == len(STYLES)
    press(tab, f"#looks >> text={STYLES[1]}")
    wait_until(lambda: declared(box)[LOOK].value == STYLES[1], lambda: tab.inner_text("#said"))
    expect(tab.locator(f'#looks button:has-text("{STYLES[1]}")')).to_have_attribute("aria-pressed", "true")


@ON_BOTH
def test_the_wall_is_seen_above_the_looks(
    context: BrowserContext, hall: tuple[Box, Page, Node], wall: Projection
) -> None:
    """As the projector shows it, with newer pictures while somebody looks; without the PIN too."""
    tab = context.new_page()
    asked: set[str] = set()
    is_wall = re.compile(r"wall\.jpg")
    tab.on("response", lambda one: asked.add(one.url) if one.ok and is_wall.search(one.url) else None)
    tab.goto(hall[1].origin)
    await_box(tab)
    press(tab, '[data-page="picture"]')
    await_true(tab, "document.querySelector('#wall-now').naturalWidth > 0")
    wait_until(lambda: tab.wait_for_timeout(200) or len(asked) > 2, "no newer picture comes")
    seen, looks = tab.locator("#wall-part").bounding_box(), tab.locator("#looks").bounding_box()
    assert seen is not None and looks is not None
    assert seen["y"] < looks["y"] + 1, "above, or on a laptop next to them"


@ON_BOTH
def test_the_test_card_takes_the_place_of_the_dance_and_goes_again(
    context: BrowserContext, hall: tuple[Box, Page, Node], wall: Projection
) -> None:
    _, page, _ = hall
    tab = unlocked_tab(context, page, "picture")
    press(tab, WALL_PART)
    expect(tab.locator("#test_card")).to_have_text(re.compile("Test card|Testbild|Mire"))
    expect(tab.locator("#info")).to_have_text(re.compile("Figures|Zahlen|Chiffres"))
    for on in (True, False):
        switch(tab, wall, "#test_card", lambda picture: (picture > 240).all(axis=2).any(), on)


@ON_BOTH
def test_a_corner_follows_the_finger_on_the_wall(
    context: BrowserContext, hall: tuple[Box, Page, Node], wall: Projection
) -> None:
    box, page, _ = hall
    tab = unlocked_tab(context, page, "picture")
    press(tab, WALL_PART)
    switch(tab, wall, "#grid", lambda picture: picture[:3, :3].any(), True)
    pull(tab, "#corners button >> nth=0", lambda: _corner(box), (0.25, 0.25))
    wall.await_picture(lambda picture: not np.any(picture[:12, :20]))
    before = _corner(box)
    first = tab.locator("#corners button").nth(0)
    repeat(tab, lambda: first.press("ArrowRight"), lambda: _corner(box)[0] > before[0] + 0.001)
    corner = _corner(box)
    press(tab, "#corners-reset")
    expect(tab.locator("#said")).to_contain_text("Hold the button")
    assert _corner(box)[0] > 0.2, "a tap does not reset"
    repeat(tab, lambda: hold(tab, "#corners-reset"), lambda: _corner(box) == (0.0, 0.0))
    repeat(tab, lambda: press(tab, "#corners-undo"), lambda: _corner(box) == pytest.approx(corner, abs=0.001))
    expect(tab.locator("#corners-shape")).to_have_attribute("points", re.compile(r"^0\.2\d+,0\.2\d+ 1,0 "))
    repeat(tab, lambda: hold(tab, "#corners-reset"), lambda: _corner(box) == (0.0, 0.0))
    switch(tab, wall, "#grid", lambda picture: picture[:3, :3].any(), False)
    press(tab, RIG_PART)
    expect(tab.locator("#rig")).to_be_visible()
    expect(tab.locator("#corners")).to_be_hidden()
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_a_point_of_the_mesh_follows_the_finger_on_the_wall(
    context: BrowserContext, hall: tuple[Box, Page, Node], wall: Projection
) -> None:
    box, page, _ = hall
    tab = unlocked_tab(context, page, "picture")
    press(tab, WALL_PART)
    point = tab.locator('[data-point="12"]')
    expect(point).to_be_hidden()
    press(tab, "#mesh")

    def pulled() -> tuple[float, float]:
        warp = _kept(box).get("warp", [])
        x, y = warp[12] if warp else (0.0, 0.0)
        return x, y

    pull(tab, '[data-point="12"]', pulled, (0.1, -0.1))
    wall.await_picture(lambda picture: bool(picture.any()))
    repeat(tab, lambda: press(tab, "#corners-undo"), lambda: pulled() == pytest.approx((0, 0), abs=0.001))
    where = -0.05, 0.1
    pull(tab, '[data-point="12"]', pulled, where)  # its last step may still be on the way
    repeat(tab, lambda: hold(tab, "#corners-reset"), lambda: pulled() == (0.0, 0.0))
    repeat(tab, lambda: press(tab, "#corners-undo"), lambda: pulled() == pytest.approx(where, abs=0.01))
    repeat(tab, lambda: hold(tab, "#mesh-reset"), lambda: pulled() == (0.0, 0.0))


def switch(
    tab: Tab, wall: Projection, button: str, is_on: Callable[[np.ndarray], object], wanted: bool
) -> None:
    """Press until wall and page agree. The projector reports once a second: a page that has just opened may
    show what was pressed on another one, and its press then switches the other way."""
    pressed = tab.locator(button)

    def is_done() -> bool:
        picture = wall.newest()
        agrees = pressed.get_attribute("aria-pressed") == str(wanted).lower()
        return agrees and picture is not None and bool(is_on(picture)) == wanted

    repeat(tab, lambda: press(tab, button), is_done)


def repeat(tab: Tab, act: Callable[[], None], is_done: Callable[[], bool]) -> None:
    """Act until it is done. A projector that is busy refuses, and a person acts again; but not before the
    page has stopped to try."""

    def tried() -> bool:
        act()
        with contextlib.suppress(AssertionError):
            wait_until(is_done, patience_s=TRIES_FOR_S)
        return is_done()

    wait_until(tried, lambda: tab.inner_text("#said"))


def pull(tab: Tab, where: str, place: Callable[[], tuple[float, float]], wanted: tuple[float, float]) -> None:
    """Drag a handle until the projector keeps it there; again for what is left of the way."""

    def dragged() -> None:
        pad, handle = tab.locator("#corners").bounding_box(), tab.locator(where).bounding_box()
        assert pad is not None and handle is not None
        (x, y), left, top = place(), handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        drag(tab, left, top, (wanted[0] - x) * pad["width"], (wanted[1] - y) * pad["height"])

    repeat(tab, dragged, lambda: place() == pytest.approx(wanted, abs=0.01))


def hold(tab: Tab, where: str) -> None:
    """Until the button that asks for it lets go by itself."""
    button = tab.locator(where)
    button.dispatch_event("pointerdown")
    expect(button).not_to_have_class(re.compile("holding"))
    button.dispatch_event("pointerup")


def drag(tab: Tab, x: float, y: float, dx: float, dy: float) -> None:
    """By finger on a phone, by mouse on a laptop; slowly enough for a hand."""
    steps = [(x + dx * part / 10, y + dy * part / 10) for part in range(11)]
    if not tab.evaluate("matchMedia('(pointer: coarse)').matches"):
        tab.mouse.move(x, y)
        tab.mouse.down()
        for at in steps:
            tab.mouse.move(*at)
            tab.wait_for_timeout(50)
        tab.mouse.up()
        return
    touch = tab.context.new_cdp_session(tab)
    for kind, at in [("touchStart", steps[0]), *(("touchMove", at) for at in steps)]:
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": at[0], "y": at[1]}]})
        tab.wait_for_timeout(50)
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def _corner(box: Box) -> tuple[float, float]:
    """Where the projector keeps the first corner."""
    x, y = _kept(box).get("corners", [[0, 0]])[0]
    return float(x), float(y)


def _kept(box: Box) -> dict[str, Any]:
    file = box.box_file.with_name("projector.alignment")
    return yaml.safe_load(file.read_text()) if file.is_file() else {}
