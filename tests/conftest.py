"""What several test folders share."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def recordings_dir() -> Path:
    """Folder with the motion capture recordings, beside the repository."""
    folder = ROOT.parent / "shared" / "mocap"
    if not folder.is_dir():
        pytest.skip("the motion capture recordings (../shared/mocap) are not on this machine")
    return folder


@pytest.fixture(scope="session")
def tiny_show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small whole show bundle: 17 moving of 20 joints, 3 s of swaying, an untrained mlp really exported."""
    from tests.studio.tiny import write_tiny_show

    return write_tiny_show(tmp_path_factory.mktemp("tiny") / "show")
