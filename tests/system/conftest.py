"""The show that most boxes of this folder dance."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bundles import write_show


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_show(tmp_path_factory.mktemp("bundle") / "show")
