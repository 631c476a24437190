"""The show that most boxes of this folder dance, and the folders of a box for a preflight."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bundles import write_show
from tests.system.box_folders import Machine


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_show(tmp_path_factory.mktemp("bundle") / "show")


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)
