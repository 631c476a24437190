"""A page alone, and one beside a box that dances."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.bundles import write_show
from tests.console.page import CUES, Page, box_with_page, page_alone
from tests.system.box import Box


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    with page_alone(tmp_path) as (page, _):
        yield page


@pytest.fixture(scope="module")
def venue(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Box, Page]]:
    """A box that dances, with a sensor and two cues."""
    folder = tmp_path_factory.mktemp("venue")
    show = write_show(folder / "show", cues=CUES)
    with box_with_page(show, folder, "--journal", str(folder / "night")) as (box, page):
        yield box, page
