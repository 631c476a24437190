"""What the tests of installation share: roots to install into, and small releases."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.deploy import box_root
from tests.deploy.box_root import BoxRoot
from tests.deploy.small_release import make_key, write_release

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
    """Call it with a version; what write_release takes can be named."""

    def make(version: str, **more: object) -> Path:
        folder = tmp_path_factory.mktemp("stick") / "release"
        asked = {"key": maker, "python": str(box_root.python()), **more}
        return write_release(folder, version, **asked)  # type: ignore[arg-type]

    return make


@pytest.fixture(scope="session")
def with_first_release(make_release: MakeRelease, tmp_path_factory: pytest.TempPathFactory) -> BoxRoot:
    """A box that has release 1.0.0, switched off: its disk is to be copied."""
    box = BoxRoot(tmp_path_factory.mktemp("first"))
    box.make()
    try:
        done = box.install(make_release("1.0.0", extra_unit="bunraku-old.service"))
    finally:
        box.switch_off()
    assert done.returncode == 0, done.stderr
    return box


@pytest.fixture
def box(with_first_release: BoxRoot, tmp_path: Path) -> Iterator[BoxRoot]:
    """A box of the test's own, on which release 1.0.0 is installed."""
    own = BoxRoot(tmp_path / "box").copy_of(with_first_release)
    yield own
    own.switch_off()
