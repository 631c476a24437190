"""What several test folders share."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from hypothesis import settings

# Property tests are not timed: a busy machine must not fail them.
settings.register_profile("untimed", settings.get_profile(settings.get_current_profile_name()), deadline=None)
settings.load_profile("untimed")

ROOT = Path(__file__).resolve().parents[1]
_folders = itertools.count()


@pytest.fixture(autouse=True)
def own_runtime_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the boxes of this test meet: never in the folder of a box that runs beside the tests."""
    folder = tmp_path_factory.getbasetemp() / f"runtime-{next(_folders)}"
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(folder))
    return folder


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
