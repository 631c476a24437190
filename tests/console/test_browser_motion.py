"""What a choreographer asks of a show with networks: variations, places on the map, and what is kept."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from playwright.sync_api import Browser, expect

from appliance.cli.page_calls import pose_map
from appliance.levers.table import STRINGS, find_lever
from appliance.show.bundle import default_show_path
from appliance.show.check import verify_bundle
from appliance.show.show import load_show
from appliance.stage.stage_error import StageError
from tests.console.browser import LAPTOP, PHONE, declared, open_part, opened_context, press, unlocked_tab
from tests.console.page import Page, box_with_page
from tests.system.box import Box
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Box, Page]]:
    """A box that dances the show that comes with it."""
    folder = tmp_path_factory.mktemp("studio")
    shutil.copytree(default_show_path(), folder / "show")
    with box_with_page(folder / "show", folder, has_sensors=False) as (box, page):
        yield box, page


def numbers(box: Box, name: str) -> tuple[float, ...]:
    """The numbers of a lever, and of its fade if it has one; empty: it was never set."""
    state, lever = declared(box), find_lever(name)
    if lever is None or lever not in state:
        return ()
    fade = state[lever]
    return (lever.formatted(fade) if fade.seconds else lever.kind.formatted(fade.value))[1]


def value(box: Box, part: str) -> tuple[float, ...]:
    """What was declared last of a source."""
    return numbers(box, f"motion {part}")


def test_variations_and_places_on_the_map(browser: Browser, studio: tuple[Box, Page]) -> None:
    box, page = studio
    tab = unlocked_tab(opened_context(browser, **PHONE), page, "rehearsal")
    expect(tab.locator("#motion-part")).to_be_hidden()
    press(tab, "#phrases >> text=Variation")
    sigma = tab.locator("#vary-sigma")
    expect(sigma).to_have_value("0.7")
    expect(sigma).to_have_attribute("max", "2")
    expect(tab.locator("#path-wobble")).to_be_hidden()
    sigma.focus()
    tab.keyboard.press("ArrowRight")
    wait_until(lambda: value(box, "vary sigma") == (0.75, 1.0))
    press(tab, "#sigma-unlocked")
    expect(sigma).to_have_attribute("max", "4")
    tab.fill("#vary-seed", "12")
    tab.keyboard.press("Tab")
    wait_until(lambda: value(box, "vary seed") == (12.0,))
    press(tab, "#motion-again")
    wait_until(lambda: value(box, "again") == (1.0,))
    wait_until(lambda: _danced(page) == "vary", "no variation is danced")
    tab.fill("#motion-keep-name", "anna")

    def is_saved() -> bool:
        press(tab, "#motion-keep-form button")
        return any(one["name"] == "anna" for one in page.status()["phrases"])

    wait_until(is_saved, lambda: tab.inner_text("#said"))
    with tab.expect_response("**/api/map") as ground_plan:
        press(tab, "#phrases >> text=Map")
    assert len(ground_plan.value.json()["figures"]) == 25
    ground = tab.locator("#map")
    ground.scroll_into_view_if_needed()
    size = ground.evaluate("one => one.clientWidth")
    ground.tap(position={"x": 0.25 * size, "y": 0.25 * size})
    wait_until(lambda: value(box, "path points") == pytest.approx((0.25, 0.75), abs=0.01))
    expect(tab.locator("#map-said")).to_have_text("Staying at one place.")
    at = ground.bounding_box()
    assert at is not None
    touch = tab.context.new_cdp_session(tab)
    for kind, x in [("touchStart", 0.2), *(("touchMove", 0.2 + 0.06 * step) for step in range(1, 11))]:
        point = {"x": at["x"] + x * size, "y": at["y"] + 0.5 * size}
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [point]})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    line = wait_until(lambda: value(box, "path points") if len(value(box, "path points")) == 32 else ())
    assert line[::2] == pytest.approx([0.2 + 0.04 * place for place in range(16)], abs=0.01)
    assert line[1::2] == pytest.approx([0.5] * 16, abs=0.01)
    expect(tab.locator("#map-said")).to_have_text("Along the line and back.")
    tab.locator("#map-own").press("Enter")
    wait_until(lambda: not value(box, "path points"), lambda: tab.inner_text("#said"))
    tab.context.close()


def _danced(page: Page) -> str:
    return next((one["name"] for one in page.status()["phrases"] if one["now"]), "")


def test_the_map_of_a_show_without_one_is_refused_in_words(tmp_path: Path) -> None:
    shutil.copytree(default_show_path(), tmp_path / "show")
    file = tmp_path / "show" / "show.yaml"
    show = yaml.safe_load(file.read_text())
    del show["motion"]["path"]
    file.write_text(yaml.safe_dump(show))
    with pytest.raises(StageError, match="This show has no map"):
        pose_map(str(tmp_path / "show"))
    drawn = pose_map()
    places = [place for place in drawn["path"] if min(place) >= 0 and max(place) <= 1]
    assert len(places) > 0.8 * len(drawn["path"]), "nearly all of the dance lies on the map"
    assert len(drawn["figures"]) == 25 and all(len(one["bones"]) > 15 for one in drawn["figures"])


def test_the_settings_of_now_become_a_cue(browser: Browser, studio: tuple[Box, Page], tmp_path: Path) -> None:
    box, page = studio
    assert page.get("/api/cue/show.zip").status == page.post("/api/cue", {"name": "a"}).status == 401
    page.unlock()
    assert page.get("/api/cue/show.zip").status == 404
    for address, *given in [("/phrase", "vary"), ("/motion/vary/sigma", 1.25), ("/iterations", 6, 4)]:
        assert page.order(address, *given)["done"]
    wait_until(lambda: _danced(page) == "vary", "no variation is danced")
    wait_until(lambda: page.status()["status"]["coding"] == 6)
    assert page.order("/liveliness", 0.4, 0.5)["done"] and page.order("/seed", 12)["done"]
    wait_until(lambda: round(page.status()["status"]["liveliness"], 3) == 0.4)
    tab = unlocked_tab(opened_context(browser, **LAPTOP), page, "rehearsal")
    open_part(tab, "cue")
    for name, said in [("anna", "The cue anna is in the copy"), ("anna", "another name"), ("ben", "cue ben")]:
        tab.fill("#cue-name", name)
        press(tab, "#cue-keep")
        expect(tab.locator("#cue-said")).to_contain_text(said)
    with tab.expect_download() as got:
        press(tab, "#cue-show")
    with zipfile.ZipFile(got.value.path()) as packed:
        packed.extractall(tmp_path)
    tab.context.close()
    danced, kept = box.command[box.command.index("--show") + 1], tmp_path / "bunraku" / "show"
    assert verify_bundle(kept) == []
    lines, before = ((folder / "show.yaml").read_text().splitlines() for folder in (kept, Path(danced)))
    assert [line for line in lines if line in before] == before, "comments and all"
    cue = load_show(kept).config.cues[-1]
    assert (cue.name, cue.phrase, cue.iterations) == ("ben", "vary", (6, 4))
    assert (cue.liveliness, cue.seed) == (0.4, 12)
    assert cue.motion is not None and cue.motion.vary is not None and cue.motion.vary.sigma == 1.25
    assert cue.hands == ["lShldr", "rForeArm"], "the page's hand waits for a finger"


def test_knobs_of_springs_and_strings(browser: Browser, studio: tuple[Box, Page]) -> None:
    box, page = studio
    tab = unlocked_tab(opened_context(browser, **PHONE, locale="de-DE"), page, "rehearsal")
    open_part(tab, "springs")
    setting, feedback = tab.locator("#springs >> text=strings"), tab.locator("#springs-feedback")
    expect(tab.locator("#springs >> text=loose")).to_have_attribute("aria-pressed", "true")
    expect(feedback).to_have_value("0")
    press(tab, "#springs >> text=strings")
    expect(setting).to_have_attribute("aria-pressed", "true")
    expect(feedback).to_have_value("0.8")
    for knob, key, least in (("stiffness", "End", 10.0), ("storm", "End", 1.0), ("feedback", "Home", 0.0)):
        tab.locator(f"#springs-{knob}").focus()
        tab.keyboard.press(key)
        wait_until(lambda part=knob, reported=least: numbers(box, part) == (reported, 1.0))
    tab.locator("#springs-strings").focus()
    tab.keyboard.press("Home")
    wait_until(lambda: declared(box)[STRINGS].value == 0.0)
    with tab.expect_response("**/api/command") as kicked:
        press(tab, "#springs-kick")
    assert kicked.value.json()["done"]
    tab.context.close()
