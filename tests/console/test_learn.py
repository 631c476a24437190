"""Learn tonight, dance tomorrow, from the page: two touches, and nothing is trained while a show dances."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from appliance.console.learning import FOLDER, RECORDINGS, Learning, Wanted
from appliance.console.settings import WHERE
from appliance.pose.bvh import write_bvh
from tests.bundles import swaying_phrase
from tests.console.browser import ON_BOTH, press, unlock
from tests.console.page import Page, page_alone
from tests.system.box import Box
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime


def kept_of(box: Box) -> Path:
    """Where the page of this box keeps things."""
    return Path((box.runtime / WHERE).read_text().partition("\n")[0]).parent


@pytest.fixture
def kept(venue: tuple[Box, Page]) -> Path:
    folder = kept_of(venue[0])
    (folder / RECORDINGS / "mine").mkdir(parents=True, exist_ok=True)
    write_bvh(folder / RECORDINGS / "mine" / "sway.bvh", swaying_phrase())
    return folder


@ON_BOTH
def test_two_touches_begin_and_it_waits_for_the_show(tab: Tab, venue: tuple[Box, Page], kept: Path) -> None:
    unlock(tab, venue[1])
    press(tab, '[data-page="rehearsal"]')
    folder = tab.locator("#learn-folders button")
    expect(folder).to_have_text("box/mine · 1 files, 0.1 min")
    expect(tab.locator("#learn-begin")).to_be_disabled()
    press(tab, "#learn-folders button")
    press(tab, "#learn-begin")
    expect(tab.locator("#learn-said")).to_contain_text("Waiting until the show stops")
    learning = Learning(kept / FOLDER)
    wait_until(lambda: learning.told().get("share") == 0.0)
    assert learning.wanted() is not None and not learning.show.exists(), "nothing is trained"
    press(tab, "#learn-end")
    expect(tab.locator("#learn-said")).to_contain_text("The show stays as it is")
    assert learning.wanted() is None


def test_only_listed_folders_and_known_devices(venue: tuple[Box, Page], kept: Path) -> None:
    page = Page(venue[1].port, venue[1].box_file)
    assert page.get("/api/learn").status == 401
    assert page.post("/api/learn", {"recordings": "box/mine"}).status == 401
    page.unlock()
    assert page.get("/api/learn").value["recordings"] == [{"name": "box/mine", "files": 1, "minutes": 0.1}]
    for name in ("box/..", "box/../..", "/etc", "other/mine", "box/none", "box/\0", 7, None):
        assert page.post("/api/learn", {"recordings": name}).status == 400, name
    assert page.post("/api/learn", {"recordings": "box/mine", "minutes": 0}).status == 400
    assert page.post("/api/learn/dance", {}).status == 400, "this box keeps no shows"


def test_a_rehearsal_without_a_live_dancer_is_nothing_to_learn_from(
    venue: tuple[Box, Page], kept: Path
) -> None:
    page = Page(venue[1].port, venue[1].box_file)
    page.unlock()
    wait_until(lambda: any((venue[0].box_file.parent / "night").glob("*.segment")))
    answer = page.post("/api/learn/rehearsal", {})
    assert answer.status == 404 and "No live dancer danced" in answer.text
    assert [one.name for one in (kept / RECORDINGS).iterdir()] == ["mine"]


def test_what_was_begun_goes_on_with_the_next_page(tmp_path: Path) -> None:
    learning = Learning(tmp_path / "state" / FOLDER)
    learning.want(Wanted(str(tmp_path / "gone"), 1.0))
    assert learning.told() == {"state": "waits"}
    with page_alone(tmp_path):
        wait_until(lambda: learning.told()["state"] in ("training", "failed"))
