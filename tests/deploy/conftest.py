"""What the tests of installation share: roots to install into, and small releases."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.deploy import box_root
from tests.deploy.box_root import BoxRoot
from tests.deploy.small_release import make_key, package_of, write_release

MakeRelease = Callable[..., Path]


@pytest.fixture(scope="session")
def needs_roots() -> None:
    reason = box_root.why_not()
    if reason is not None:
        pytest.skip(f"No root to install into: {reason}.")


@pytest.fixture(scope="session")
def maker(needs_roots: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The key of the maker of all releases here that name no other one."""
    return make_key(tmp_path_factory.mktemp("keys"))


@pytest.fixture(scope="session")
def make_release(maker: Path, tmp_path_factory: pytest.TempPathFactory) -> MakeRelease:
    """Call it with a version; what write_release takes can be named. Each call gives a stick of its own."""
    made: dict[tuple[object, ...], Path] = {}

    def make(version: str, **more: Any) -> Path:
        asked: dict[str, Any] = {"key": maker, "python": str(box_root.python()), **more}
        wanted = (version, *sorted(asked.items()))
        if wanted not in made:
            made[wanted] = tmp_path_factory.mktemp("made") / "release"
            write_release(made[wanted], version, **asked)
        return Path(shutil.copytree(made[wanted], tmp_path_factory.mktemp("stick") / "release"))

    return make


@pytest.fixture(scope="session")
def with_first_release(make_release: MakeRelease, tmp_path_factory: pytest.TempPathFactory) -> BoxRoot:
    """A box that has release 1.0.0, switched off: its disk is to be copied."""
    box = BoxRoot(tmp_path_factory.mktemp("first"))
    box.make()
    try:
        done = box.dpkg("--install", package_of(make_release("1.0.0", extra_unit="bunraku-old.service")))
    finally:
        box.switch_off()
    assert done.returncode == 0, done.stdout + done.stderr
    return box


@pytest.fixture
def box(with_first_release: BoxRoot, tmp_path: Path) -> Iterator[BoxRoot]:
    """A box of the test's own, on which release 1.0.0 is installed."""
    own = BoxRoot(tmp_path / "box").copy_of(with_first_release)
    yield own
    own.switch_off()
