"""The dance in a browser: as it leaves the box, and again from the journal."""

from __future__ import annotations

import contextlib
import re
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from appliance.outputs.frame_reader import FrameReader
from appliance.pose.bvh import read_bvh
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import Run, read_journal
from tests.bundles import FIGURE
from tests.console.browser import ON_A_LAPTOP, await_true, press
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import run_bunraku, wait_until

pytestmark = pytest.mark.realtime


@ON_A_LAPTOP
def test_the_dance_is_seen_as_it_leaves_the_box(tab: Tab, venue: tuple[Box, Page]) -> None:
    box, _ = venue
    reader = FrameReader(box.runtime)
    press(tab, '[data-page="dance"]')
    await_true(tab, "seen.tick > 0")
    expect(tab.locator("#held")).to_contain_text("Held:")
    await_true(tab, "seen.held.length === 1 && seen.held[0][0] === 'lShldr' && seen.held[0][1] <= 1")
    assert tab.evaluate("seen.puppets") == 2
    front, above = (tab.locator(f"#views >> text={name}") for name in ("Front", "Above"))
    expect(front).to_have_attribute("aria-pressed", "true")
    wait_until(lambda: 0.7 < tab.evaluate(FILLED) < 1, lambda: f"filled: {tab.evaluate(FILLED)}")
    before = tab.locator("#stage").screenshot()

    def seen_and_sent() -> tuple[int, Any, Any] | None:
        """A tick, and its root on the page and in the box, which keeps a second of frames."""
        tick, root = tab.evaluate("[seen.tick, seen.root]")
        sent = {frame.tick: frame.puppets[0].root for frame in reader.frames(60, time.monotonic())}
        return (tick, root, sent[int(tick)]) if int(tick) in sent else None

    tick, root, sent_root = wait_until(seen_and_sent, "the page shows what the box never sent")
    assert np.allclose(root, sent_root, atol=0.001)
    await_true(tab, f"seen.tick > {tick + 20}")
    assert tab.locator("#stage").screenshot() != before, "the figure moves"
    tab.locator("#show-dance").uncheck()
    expect(tab.locator("#held")).not_to_contain_text("No frame")

    def rests() -> bool:
        before = tab.evaluate("seen.frames")
        tab.evaluate(PICTURES_COUNTED)
        tab.wait_for_timeout(1000)
        return bool(tab.evaluate("seen.frames") == before)

    wait_until(rests, "switched off, it costs nothing")  # what was on its way has come
    count = tab.evaluate("seen.frames")
    assert tab.evaluate("pictures / (performance.now() - picturesFrom)") < 0.01, "it draws what it has drawn"
    drawn = "document.querySelector('#stage').toDataURL()"
    before = tab.evaluate(drawn)
    press(tab, "#views >> text=Above")
    expect(above).to_have_attribute("aria-pressed", "true")
    expect(front).to_have_attribute("aria-pressed", "false")
    wait_until(lambda: tab.evaluate(drawn) != before, "it is seen from elsewhere")
    tab.locator("#show-dance").check()
    await_true(tab, f"seen.frames > {count}")
    reader.close()


# How much of the height of the stage bodies take: they are brighter than the floor.
FILLED = """() => {
  const stage = document.querySelector("#stage"), { width, height } = stage;
  const { data } = stage.getContext("2d").getImageData(0, 0, width, height), rows = [];
  for (let at = 0; at < data.length; at += 4) if (data[at] > 130) rows.push(Math.floor(at / 4 / width));
  return (rows.at(-1) - rows[0]) / height;
}"""
# Of the display, which the page asks for from now on.
PICTURES_COUNTED = """() => {
  const ask = requestAnimationFrame;
  [window.pictures, window.picturesFrom] = [0, performance.now()];
  window.requestAnimationFrame = (draw) => {
    window.pictures++;
    return ask(draw);
  };
}"""


def test_the_phrase_stands_beside_the_puppet_as_it_is_without_hands(
    tab: Tab, venue: tuple[Box, Page]
) -> None:
    """In the phrase the left arm stays with the swaying chest; a hand holds the puppet's elsewhere."""
    press(tab, '[data-page="dance"]')
    await_true(tab, "seen.tick > 0")
    assert not tab.evaluate("seen.ghost"), "only if wished"
    tab.locator("#show-ghost").check()
    await_true(tab, "Boolean(seen.ghost)")
    swayed = set()

    def has_swayed() -> bool:
        places = np.array(tab.evaluate("seen.ghost")).reshape(-1, 3)
        chest, shoulder, elbow = (places[FIGURE.index(name)] for name in ("Chest", "lShldr", "lForeArm"))
        collar, arm = shoulder - chest, elbow - shoulder
        cosine = collar @ arm / np.linalg.norm(collar) / np.linalg.norm(arm)
        assert cosine == pytest.approx(2 / np.sqrt(5), abs=0.02), "as FIGURE and the phrase have it"
        assert min(places[:, 1]) == pytest.approx(0.05, abs=0.01), "it stands on the floor"
        swayed.add(round(float(np.arctan2(arm[1], np.hypot(arm[0], arm[2]))), 1))
        return len(swayed) >= 4

    wait_until(has_swayed, "the phrase does not move")
    assert tab.evaluate("seen.puppets") == 2
    tab.locator("#show-ghost").uncheck()
    await_true(tab, "!seen.ghost")


def test_what_happened_is_danced_again(tab: Tab, venue: tuple[Box, Page]) -> None:
    """The journal's newest run: a timeline, and a stretch of it in 3D, the poses those of the journal."""
    wait_until(lambda: len(recorded(venue[0]).ticks) > 100, "nothing was recorded")
    press(tab, '[data-page="happened"]')
    expect(tab.locator("#happened-sum")).to_contain_text("late ticks")
    assert tab.evaluate("document.querySelector('#timeline').width") > 200
    expect(tab.locator("#happened-kinds button")).to_have_count(4)
    entries = tab.locator("#happened-events details").first
    expect(entries.locator("li").first).to_contain_text(re.compile(r"\d\d:\d\d:\d\d(message|command|fault)."))
    at = tab.locator("#happened-second")
    tab.locator("#timeline").click(position={"x": 52, "y": 40})  # where its axis begins
    expect(at).to_have_value("0")
    at.fill("0")
    press(tab, "#happened-dance")
    expect(tab.locator("#again")).to_be_visible()
    await_true(tab, "seen.tick > 0")
    seen = {tuple(tab.evaluate("[seen.tick, ...seen.root]")) for _ in range(20)}
    ticks = recorded(venue[0]).ticks
    for tick, *root in seen:
        (row,) = ticks[ticks["tick"] == tick]
        positions, _ = recorded(venue[0]).skeleton.forward_kinematics(row["pose"][0], row["root"][0])
        np.testing.assert_allclose(root, positions[0], atol=2e-3)
    with tab.expect_download() as download:
        press(tab, "#happened-bvh")
    dance = read_bvh(download.value.path(), metres_per_unit=0.01)
    assert dance.seconds > 1.0
    press(tab, '[data-page="tonight"]')
    expect(tab.locator("#again")).to_be_hidden()


@ON_A_LAPTOP
def test_the_journal_itself_is_saved_by_who_gave_the_pin_and_danced_again(
    tab: Tab, venue: tuple[Box, Page], tmp_path: Path
) -> None:
    wait_until(lambda: len(recorded(venue[0]).ticks) > 100, "nothing was recorded")
    path = "/api/happened/dance.bunraku?run=1&from=0"
    assert venue[1].get(path, Cookie="none").status == 401
    press(tab, '[data-page="happened"]')
    tab.locator("#happened-second").fill("0")
    press(tab, "#happened-bunraku")
    tab.fill("#pin-input", venue[1].pin)
    with tab.expect_download() as download:
        press(tab, "#pin-send")
    assert download.value.suggested_filename.endswith(".bunraku")
    saved = tmp_path / download.value.suggested_filename
    download.value.save_as(saved)
    ticks = read_journal(saved).runs[0].ticks
    assert ticks.tobytes() == recorded(venue[0]).ticks[: len(ticks)].tobytes(), "as it was recorded"
    again = run_bunraku("replay", saved)
    assert again.returncode == 0 and "All are the same" in again.stdout, again.stdout + again.stderr


def recorded(box: Box) -> Run:
    with contextlib.suppress(JournalError):
        return read_journal(box.box_file.parent / "night").runs[-1]
    return cast(Run, SimpleNamespace(ticks=()))
