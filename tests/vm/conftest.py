"""The image that the tests of the virtual machine start, and the table of what they measured."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.vm.machine import missing_programs


@pytest.fixture(scope="session")
def image() -> Path:
    """The disk image that `make image` made; skips with the reason where there is none."""
    named = os.environ.get("BUNRAKU_IMAGE")
    if not named:
        pytest.skip("a whole machine in software takes up to an hour: make test-vm starts it")
    missing = missing_programs(Path(named))
    if missing:
        pytest.skip(f"no machine in software here: {', '.join(missing)} missing")
    return Path(named)
