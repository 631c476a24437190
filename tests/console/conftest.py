"""A page alone, and one beside a box that dances."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, sync_playwright
from playwright.sync_api import Page as Tab

from tests.bundles import write_show
from tests.console.browser import PHONE, await_box, observe, opened_context
from tests.console.page import CUES, Page, box_with_page, page_alone
from tests.system.box import Box
from tools.page_pictures import CHROMIUM


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that need the venue run last, one after the other: its box dances from the first to the last."""
    places = [place for place, item in enumerate(items) if item.nodeid.startswith("tests/console/")]
    here = [items[place] for place in places]
    needs = {item.path for item in here if "venue" in getattr(item, "fixturenames", ())}
    for place, item in zip(places, sorted(here, key=lambda item: item.path in needs), strict=True):
        items[place] = item


@pytest.fixture
def own_page(tmp_path: Path) -> Iterator[Page]:
    """A page whose PIN, devices or files a test spoils."""
    with page_alone(tmp_path) as (page, _):
        yield page


@pytest.fixture(scope="module")
def open_page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with page_alone(tmp_path_factory.mktemp("page")) as (page, _):
        yield page


@pytest.fixture
def page(open_page: Page) -> Page:
    """The page of this module, on a device that has not given the PIN. No test gives it a wrong one."""
    open_page.cookie = ""
    return open_page


PUPPETS = [{"name": "left", "x": -0.8}, {"name": "right", "x": 0.8, "turned": 30}]


@pytest.fixture(scope="package")
def venue(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Box, Page]]:
    """A box on which two puppets dance, with a sensor and two cues; until the last test of this folder."""
    folder = tmp_path_factory.mktemp("venue")
    show = write_show(folder / "show", cues=CUES, puppets=PUPPETS)
    with box_with_page(show, folder, "--journal", str(folder / "night")) as (box, page):
        yield box, page


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Its loop of events is this thread's until it ends: no longer than a module's tests."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def context(request: pytest.FixtureRequest, browser: Browser) -> Iterator[BrowserContext]:
    """A phone; or what a test is marked with: ON_A_LAPTOP, ON_BOTH."""
    made = opened_context(browser, **getattr(request, "param", PHONE))
    yield made
    made.close()


@pytest.fixture
def tab(context: BrowserContext, venue: tuple[Box, Page]) -> Iterator[Tab]:
    """The page, opened; an error of its scripts fails the test."""
    opened = context.new_page()
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.goto(venue[1].origin)
    await_box(opened)
    observe(opened)
    yield opened
    assert not errors
