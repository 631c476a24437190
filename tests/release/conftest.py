"""A venue in a folder of the test's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.release.venue import Venue


@pytest.fixture
def venue(tmp_path: Path) -> Venue:
    return Venue(tmp_path)
