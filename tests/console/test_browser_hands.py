"""Hands of a browser on the figure: a ring is dragged, and the joint is the puppet's again in every end."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, expect
from playwright.sync_api import Page as Tab

from appliance.outputs.frame_reader import FrameReader
from tests.bundles import WORN, write_show
from tests.console.browser import LAPTOP, ON_BOTH, PHONE, await_true, opened_context, unlocked_tab
from tests.console.page import Page, box_with_page
from tests.system.box import Box
from tests.system.processes import children_running, wait_until

pytestmark = pytest.mark.realtime

HELD, PLACED = "rThigh", "Chest"
NEAR_PX = 20.0  # a bone keeps its length, and the body sways; untouched, the ring is 45 px away
Studio = tuple[Box, Page, FrameReader]


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    """A box whose show has two hands for the page, one of them by position."""
    folder = tmp_path_factory.mktemp("studio")
    hands = [WORN, {"osc": True, "joint": HELD}, {"osc": True, "joint": PLACED, "by": "position"}]
    show = write_show(folder / "show", hands=hands)
    with box_with_page(show, folder, has_sensors=False) as (box, page):
        reader = FrameReader(box.runtime)
        yield box, page, reader
        reader.close()


def held(studio: Studio, joint: str = HELD) -> float:
    """How firmly a joint is held now."""
    reader = studio[2]
    frame, facts = reader.newest(time.monotonic()), reader.facts
    assert frame is not None and facts is not None
    return float(frame.puppets[0].holds[facts.skeleton.index(joint)])


def opened(context: BrowserContext, studio: Studio) -> Tab:
    """The rehearsal on a device that gave the PIN, with its ring drawn."""
    tab = unlocked_tab(context, studio[1], "rehearsal")
    await_true(tab, "Boolean(seen.rings)")
    return tab


def ring(tab: Tab, joint: str = HELD) -> tuple[float, float]:
    """Where a joint's ring is, in pixels of the window."""
    rings = {name: at for name, *at in tab.evaluate("seen.rings")}
    assert rings.keys() == {HELD, PLACED}, "the worn sensor's joint has no ring"
    x, y = rings[joint]
    box = tab.locator("#figure").bounding_box()
    assert box is not None
    return box["x"] + x, box["y"] + y


class Finger:
    """Or the mouse on a laptop."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        self._touch: Any = None
        if tab.evaluate("matchMedia('(pointer: coarse)').matches"):
            self._touch = tab.context.new_cdp_session(tab)

    def down(self, x: float, y: float) -> None:
        if self._touch:
            self._touch.send("Input.dispatchTouchEvent", _touch("touchStart", (x, y)))
        else:
            self._tab.mouse.move(x, y)
            self._tab.mouse.down()

    def move(self, x: float, y: float) -> None:
        if self._touch:
            self._touch.send("Input.dispatchTouchEvent", _touch("touchMove", (x, y)))
        else:
            self._tab.mouse.move(x, y)

    def up(self) -> None:
        if self._touch:
            self._touch.send("Input.dispatchTouchEvent", _touch("touchEnd"))
        else:
            self._tab.mouse.up()


def _touch(kind: str, *at: tuple[float, float]) -> dict[str, Any]:
    return {"type": kind, "touchPoints": [{"x": x, "y": y} for x, y in at]}


@ON_BOTH
def test_a_ring_that_is_dragged_is_a_hand(context: BrowserContext, studio: Studio) -> None:
    tab = opened(context, studio)
    finger, (x, y) = Finger(tab), ring(tab)
    assert held(studio) == 0.0
    finger.down(x, y)
    finger.move(x + 20, y - 20)
    finger.move(x + 45, y - 45)
    wait_until(lambda: held(studio) == 1.0, "the joint is not held")
    expect(tab.locator("#figure-said")).to_contain_text("right thigh")

    def apart() -> float:
        at = ring(tab)
        return max(abs(at[0] - x - 45), abs(at[1] - y + 45))

    wait_until(lambda: apart() < NEAR_PX, lambda: f"the ring is {apart()} px from the finger")
    finger.up()
    wait_until(lambda: held(studio) == 0.0, "lifted, and still held")
    refused = tab.locator("#said.refused").all_inner_texts()
    assert all("not answer" in one for one in refused), refused  # a stage that was held up for half a second


def test_a_square_ring_takes_its_joint_to_a_place(browser: Browser, studio: Studio) -> None:
    context = opened_context(browser, **LAPTOP)
    tab = opened(context, studio)
    expect(tab.locator("#figure-place")).to_be_visible()
    sent: list[str] = []
    tab.on("websocket", lambda socket: socket.on("framesent", lambda said: sent.append(str(said))))
    finger, (x, y) = Finger(tab), ring(tab, PLACED)
    frame = studio[2].newest(time.monotonic())
    assert frame is not None and studio[2].facts is not None
    stood = frame.puppets[0].positions[studio[2].facts.skeleton.index(PLACED)]
    finger.down(x, y)
    wait_until(lambda: held(studio, PLACED) == 1.0, "the joint is not held")
    finger.move(x, y - 60)

    def places() -> list[list[float]]:
        return [one["at"] for one in map(json.loads, list(sent)) if one["joint"] == PLACED and "at" in one]

    def rise() -> float:
        tab.wait_for_timeout(20)  # what was sent is told while the page is waited for
        heights = [at[1] for at in places()]
        return heights[-1] - heights[0] if heights else 0.0

    wait_until(lambda: rise() > 0.05, "the finger went up, and the place has not")
    first, *_, last = places()
    assert first == pytest.approx(stood.tolist(), abs=0.08), "it is taken where it is"
    assert np.hypot(last[0] - first[0], last[2] - first[2]) < 0.5 * (last[1] - first[1])
    finger.up()
    wait_until(lambda: held(studio, PLACED) == 0.0, "lifted, and still held")
    context.close()


def test_a_phone_that_falls_asleep_gives_the_joint_back(browser: Browser, studio: Studio) -> None:
    """Its page runs no scripts, and never says that the finger is gone."""
    context = opened_context(browser, **PHONE)
    tab = opened(context, studio)
    finger = Finger(tab)
    finger.down(*ring(tab))
    wait_until(lambda: held(studio) == 1.0)
    sleep = context.new_cdp_session(tab)
    sleep.send("Debugger.enable")
    sleep.send("Debugger.pause")
    wait_until(lambda: held(studio) == 0.0, "asleep, and still held")
    sleep.send("Debugger.resume")
    sleep.send("Debugger.disable")
    finger.up()
    finger.down(*ring(tab))
    wait_until(lambda: held(studio) == 1.0, "awake, it cannot be taken again")
    context.close()
    wait_until(lambda: held(studio) == 0.0, "the browser is closed, and still held")


def test_a_page_that_is_killed_gives_the_joint_back(browser: Browser, studio: Studio) -> None:
    context = opened_context(browser, **LAPTOP)
    tab = opened(context, studio)
    Finger(tab).down(*ring(tab))
    wait_until(lambda: held(studio) == 1.0)
    (process,) = children_running(studio[0].process.pid, "appliance.console")
    tab.evaluate("document.getElementById('figure').remove()")  # its browser is not the one that helps
    os.kill(process, signal.SIGKILL)
    context.close()
    wait_until(lambda: held(studio) == 0.0, "nothing gave it back")


SPOKEN = """async (said) => {
  const socket = new WebSocket(`ws://${location.host}/hands`);
  return await new Promise((told) => {
    socket.onmessage = (event) => told(JSON.parse(event.data).refused);
    socket.onclose = (event) => told(event.code);
    socket.onopen = () => socket.send(said);
  });
}"""


def test_who_may_hold_what(browser: Browser, studio: Studio) -> None:
    stranger = browser.new_page()
    stranger.goto(studio[1].origin)
    held_there = json.dumps({"joint": HELD, "turned": [1, 0, 0, 0]})
    assert stranger.evaluate(SPOKEN, held_there) == 1006, "without the PIN there is no hand"
    tab = opened(opened_context(browser, **LAPTOP), studio)
    turned, at = [1, 0, 0, 0], [0, 1, 0]
    places = [{"joint": HELD, "at": at[:2]}, {"joint": HELD, "at": [0, 1e3, 0]}, {"at": at}]
    both = {"joint": HELD, "at": at, "turned": turned}
    spoilt_ones = ["{", "[]", '{"joint": ""}', '{"joint": "a", "turned": [0, 0, 0, 0]}', "[" * 400]
    for spoilt in (*spoilt_ones, *map(json.dumps, [*places, both])):
        assert tab.evaluate(SPOKEN, spoilt) == 1008, spoilt
    assert "No hand of this show holds 'lShldr'" in tab.evaluate(
        SPOKEN, json.dumps({"joint": "lShldr", "turned": [1, 0, 0, 0]})
    )
    assert "takes an orientation" in tab.evaluate(SPOKEN, json.dumps({"joint": HELD, "at": at}))
    Finger(tab).down(*ring(tab))
    wait_until(lambda: held(studio) == 1.0)
    assert "Another browser holds" in tab.evaluate(SPOKEN, held_there)
    wait_until(lambda: held(studio) == 1.0, "the refused one took it away")
    tab.evaluate("location.hash = 'tonight'")
    await_true(tab, "document.body.dataset.shown === 'tonight'")
    wait_until(lambda: held(studio) == 0.0, "away from the page it is still held")
    tab.context.close()
    stranger.close()
