"""The page on which latency is proven, in a browser: it begins, grows, ends in a document."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import Browser, expect
from playwright.sync_api import Page as Tab

from tests.console.browser import (
    ON_A_LAPTOP,
    ON_BOTH,
    PATIENCE_MS,
    PHONE,
    await_box,
    await_true,
    declared,
    opened_context,
    press,
    unlock,
)
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import children, has_argument, wait_until

pytestmark = pytest.mark.realtime

MEASURED_WITHIN_MS = 10 * PATIENCE_MS  # a measurement of six seconds starts the box five times
STAGE_RATE = re.compile(r"(49|50)\.\d Hz")


def test_latency_is_proven_on_a_phone_once_the_show_is_stopped(
    browser: Browser, venue: tuple[Box, Page], tmp_path: Path
) -> None:
    box, page = venue
    context = opened_context(browser, **PHONE)
    tab = context.new_page()
    tab.goto(page.origin)
    await_box(tab)
    press(tab, '[data-page="prove"]')
    expect(tab.locator("#prove-said")).to_contain_text("Only measuring stops it")
    tab.select_option("#prove-seconds", "6")
    tab.evaluate(READINGS_COUNTED)
    press(tab, "#prove-begin")
    expect(tab.locator("#prove-begin")).to_contain_text("Sure?")
    assert declared(box).going, "it asks before it stops the show"
    press(tab, "#prove-begin")
    tab.fill("#pin-input", page.pin)
    press(tab, "#pin-send")
    wait_until(lambda: not declared(box).going)
    await_true(tab, "readings > 20")
    await_true(tab, "drawn.size > 2")  # the plots grow
    assert page.post("/api/prove", {"kind": "doctor"}, Cookie=cookie(tab)).status == 409, "one at a time"
    tab.wait_for_selector("#prove-document", timeout=MEASURED_WITHIN_MS)
    proof = page.get(tab.get_attribute("#prove-json", "href") or "").value
    expect(tab.locator("#prove-verdict")).to_have_text(
        "All limits met." if proof["holds"] else "A limit is not met."
    )
    assert {"machine", "software", "show", "box_file", "made", "limits", "figures"} <= set(proof)
    assert proof["show"]["name"] == page.status()["status"]["show"]
    counted = [ms for at, ms in zip(proof["at_s"], proof["transport_ms"], strict=True) if at >= 3.0]
    assert abs(sorted(counted)[len(counted) // 2] - proof["figures"]["transport_ms"]["p50"]) < 1.0
    expect(tab.locator("#prove-lines li")).to_have_count(len(proof["limits"]))
    with tab.expect_download() as download:
        press(tab, "#prove-png")
    with Image.open(download.value.path()) as sheet:
        assert sheet.size == (1240, 1754) and len(sheet.convert("L").getcolors() or ()) > 50
    with tab.expect_download() as download:
        press(tab, "#prove-json")
    assert json.loads(download.value.path().read_text()) == proof
    press(tab, '[data-page="tonight"]')
    press(tab, "#resume")
    wait_until(lambda: declared(box).going)
    context.close()


@ON_BOTH
def test_limits_are_marks_on_scales_and_the_ones_that_are_not_met_come_first(tab: Tab) -> None:
    values = {"tick, median": (1.1, 2.0), "tick, p99": (7.5, 6.0), "hand to sound, median": (None, 15.0)}
    limits = [
        {
            "label": label,
            "value": value,
            "most": most,
            "unit": "ms",
            "holds": value is not None and value <= most,
        }
        for label, (value, most) in values.items()
    ]
    head = {"id": "000001", "kind": "latency", "made": 1_767_816_900.0, "holds": False}
    about = {"host": "box", "machine": {"cores": 4, "memory_mb": 1}, "software": {}, "box_file": None}
    figures = {"transport_ms": {"p50": 1.0}, "response_ms": {"p50": 30.0}}
    proof = {**head, **about, "limits": limits, "figures": figures, "show": {"name": "a", "checksum": "b"}}
    proof |= {"seconds": 6, "settling_s": 3.0, "at_s": [1.0, 4.0], "transport_ms": [1.0, 1.0]}
    listed = {"runs": None, "show_goes": False, "proofs": [head]}
    tab.route("**/api/prove", lambda route: route.fulfill(json=listed))
    tab.route("**/api/prove/000001", lambda route: route.fulfill(json=proof))
    press(tab, '[data-page="prove"]')
    press(tab, "#proofs button")
    lines = tab.locator("#prove-lines li")
    expect(lines).to_have_text([re.compile(said) for said in ("tick, p99", "hand to sound", "tick, median")])
    share = "one => ['--value', '--mark'].map((name) => parseFloat(one.style.getPropertyValue(name)))"
    over, unknown, under = (lines.nth(place).locator(".scale").evaluate(share) for place in range(3))
    assert over[0] > over[1] and under[0] < under[1] and unknown[0] == 0
    assert over[1] == under[1] == unknown[1] < 100, "the mark is at the same place of each scale"
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")


# From now on: the readings in what the page is told of a measurement, and its pictures of them.
READINGS_COUNTED = """() => {
  const ask = fetch, plots = document.querySelector("#prove-plots"), drawn = window.drawn = new Set();
  setInterval(() => drawn.add(plots.toDataURL()), 200);
  window.readings = 0;
  window.fetch = async (path, options) => {
    const answer = await ask(path, options);
    if (path.startsWith("/api/prove/progress")) {
      const lines = (await answer.clone().text()).split("\\n").filter(Boolean);
      for (const line of lines) window.readings += JSON.parse(line).at_s?.length ?? 0;
    }
    return answer;
  };
}"""


def cookie(tab: Tab) -> str:
    """What the box remembers this browser by."""
    return "; ".join(f"{one['name']}={one['value']}" for one in tab.context.cookies())


def test_the_doctor_looks_while_the_show_goes_on(tab: Tab, venue: tuple[Box, Page]) -> None:
    box, page = venue
    unlock(tab, page)
    press(tab, '[data-page="prove"]')
    press(tab, "#prove-doctor")
    tab.wait_for_selector("#prove-document", timeout=MEASURED_WITHIN_MS)
    expect(tab.locator("#prove-lines")).to_contain_text(STAGE_RATE)
    expect(tab.locator("#proofs li").first).to_contain_text("Check of the box")
    proof = page.get(tab.get_attribute("#prove-json", "href") or "").value
    assert proof["kind"] == "doctor"
    assert proof["holds"] == all(one["verdict"] != "wrong" for one in proof["findings"])
    wait_until(lambda: not ours(box.process.pid, "appliance.cli.proof"))
    tab.reload()
    await_box(tab)
    tab.locator("#proofs button").first.press("Enter")
    expect(tab.locator("#prove-lines")).to_contain_text(STAGE_RATE)


def ours(pid: int, word: str) -> bool:
    """Whether a process below this one has this word on its command line."""
    return any(has_argument(child, word) or ours(child, word) for child in children(pid))


@ON_A_LAPTOP
def test_a_measurement_ends_when_the_show_goes_on(tab: Tab, venue: tuple[Box, Page]) -> None:
    """It must not take the time of a dance that people see; neither a box nor a sensor of it stays."""
    box, page = venue
    unlock(tab, page)
    press(tab, '[data-page="tonight"]')
    press(tab, "#stop")
    wait_until(lambda: not page.get("/api/prove").value["show_goes"], "the show does not come to its end")
    press(tab, '[data-page="prove"]')
    press(tab, "#prove-begin")
    expect(tab.locator("#prove-said")).to_contain_text("locked to the sensor")
    wait_until(lambda: ours(box.process.pid, "hw_sim"), "nothing is measured")
    press(tab, '[data-page="tonight"]')
    press(tab, "#resume")
    wait_until(lambda: not ours(box.process.pid, "measure"), "the measurement goes on")
    wait_until(lambda: not ours(box.process.pid, "hw_sim"), "its sensor goes on")
    press(tab, '[data-page="prove"]')
    expect(tab.locator("#prove-begin")).to_be_enabled()
    assert "Nothing was kept" in page.get("/api/prove/progress").text
