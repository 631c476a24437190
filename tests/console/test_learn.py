"""Learn tonight, dance tomorrow, from the page: two touches, and nothing is trained while a show dances."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page as Tab
from playwright.sync_api import expect

from appliance.console.learn import LARGEST_RECORDING
from appliance.console.learning import FOLDER, RECORDINGS, Learning, Wanted
from appliance.console.settings import WHERE
from appliance.pose.bvh import write_bvh
from appliance.show.bundle import bundled_shows
from tests.bundles import swaying_phrase, write_show
from tests.console.browser import ON_A_LAPTOP, ON_BOTH, open_part, press, unlock
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


@pytest.fixture(autouse=True)
def nothing_stays(venue: tuple[Box, Page]) -> Iterator[None]:
    """What was uploaded is gone before the next test."""
    yield
    for folder in (kept_of(venue[0]) / RECORDINGS).glob("uploaded-*"):
        shutil.rmtree(folder)


@ON_BOTH
def test_two_touches_begin_and_it_waits_for_the_show(tab: Tab, venue: tuple[Box, Page], kept: Path) -> None:
    unlock(tab, venue[1])
    press(tab, '[data-page="rehearsal"]')
    open_part(tab, "learn")
    folder = tab.locator("#learn-folders button")
    expect(folder).to_have_text("box/mine · 1 files, 0.1 min")
    expect(tab.locator("#learn-begin")).to_be_disabled()
    tab.evaluate(
        "window.touches = 0; addEventListener('click', (one) => { touches += one.isTrusted; }, true)"
    )
    press(tab, "#learn-folders button")
    press(tab, "#learn-begin")
    expect(tab.locator("#learn-said")).to_contain_text("Waiting until the show stops")
    learning = Learning(kept / FOLDER)
    wait_until(lambda: learning.reported().get("share") == 0.0)
    assert learning.wanted() is not None and not learning.show.exists(), "nothing is trained"
    assert tab.evaluate("touches") == 2
    press(tab, "#learn-end")
    expect(tab.locator("#learn-said")).to_contain_text("The show stays as it is")
    assert learning.wanted() is None


@ON_A_LAPTOP
def test_recordings_from_the_browser_are_learned_from_another_show(
    tab: Tab, venue: tuple[Box, Page], tmp_path: Path
) -> None:
    kept = kept_of(venue[0])
    write_bvh(tmp_path / "solo.bvh", swaying_phrase())
    (tmp_path / "torn.bvh").write_bytes((tmp_path / "solo.bvh").read_bytes()[:2000])
    unlock(tab, venue[1])
    press(tab, '[data-page="rehearsal"]')
    open_part(tab, "learn")
    tab.locator("#learn-files").set_input_files([tmp_path / "solo.bvh"])
    uploaded = tab.locator("#learn-folders button", has_text="upload of ")
    expect(uploaded).to_contain_text("1 files, 0.1 min")
    expect(uploaded).to_have_attribute("aria-pressed", "true")
    (folder,) = (kept / RECORDINGS).glob("uploaded-*")
    assert (folder / "solo.bvh").read_bytes() == (tmp_path / "solo.bvh").read_bytes()
    tab.locator("#learn-files").set_input_files([tmp_path / "torn.bvh"])
    expect(tab.locator("#learn-said")).to_contain_text("torn.bvh: there is less than a second")
    assert [one.name for one in folder.iterdir()] == ["solo.bvh"]
    tab.select_option("#learn-show", "martial")
    press(tab, "#learn-begin")
    learning = Learning(kept / FOLDER)
    wait_until(lambda: learning.wanted() is not None)
    assert learning.wanted() == Wanted(str(folder), 60.0, "martial")
    press(tab, "#learn-end")
    wait_until(lambda: learning.wanted() is None, "it goes on in the next test")


def test_what_is_uploaded_is_bounded_and_a_recording(venue: tuple[Box, Page], kept: Path) -> None:
    page = Page(venue[1].port, venue[1].box_file)
    body = (kept / RECORDINGS / "mine" / "sway.bvh").read_bytes()
    assert page.post("/api/learn/recording?name=x.bvh", body).status == 401
    page.unlock()
    for name in ("x.fbx", ".x.bvh", "..%2Fx.bvh", "a%2Fb.bvh", "%00.bvh", "", "x" * 120 + ".bvh"):
        assert page.post(f"/api/learn/recording?name={name}", body).status == 400, name
    for torn in (b"", b"no recording", body[:3000]):
        refused = page.post("/api/learn/recording?name=x.bvh", torn)
        assert refused.status == 404 and refused.text.startswith("x.bvh:"), refused
    assert page.post("/api/learn/recording?name=x.bvh", bytes(LARGEST_RECORDING + 1)).status == 503
    assert not list((kept / RECORDINGS).glob("uploaded-*")), "nothing is left of what was refused"
    for name in ("/etc", "martial_show", "..", 7, None):
        answer = page.post("/api/learn", {"recordings": "box/mine", "begins_with": name})
        assert answer.status == 400 and "no such show" in answer.text, name


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


def test_a_learning_begins_with_any_show_of_the_box_the_last_learned_too(
    venue: tuple[Box, Page], kept: Path
) -> None:
    page, learning = Page(venue[1].port, venue[1].box_file), Learning(kept / FOLDER)
    page.unlock()
    bundled = list(bundled_shows())
    listed = page.get("/api/learn").value["shows"]
    assert [one["id"] for one in listed] == [str(venue[0].box_file.parent / "show"), *bundled]
    assert [one["danced"] for one in listed] == [True, *(False for _ in bundled)]
    write_show(learning.show)
    assert len(page.get("/api/learn").value["shows"]) == len(listed), "it is not checked yet"
    learning.report(state="worse")
    newest = page.get("/api/learn").value["shows"][0]
    assert newest["id"] == str(learning.show) and newest["since"] > listed[0]["since"]
    assert page.post("/api/learn", {"recordings": "box/mine", "begins_with": newest["id"]}).status == 200
    wanted = learning.wanted()
    assert wanted is not None and wanted.begins_with == str(learning.before)
    assert (learning.before / "show.yaml").is_file() and not learning.show.exists()
    assert page.get("/api/learn").value["shows"] == [], "another one is chosen when this has ended"
    page.post("/api/learn/end", {})


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
    assert learning.reported() == {"state": "waits"}
    with page_alone(tmp_path):
        wait_until(lambda: learning.reported()["state"] in ("training", "failed"))
