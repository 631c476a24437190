"""The plug is pulled while dpkg installs a release: the box has the old release or the new one, whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot, taken
from tests.deploy.cutting import changes, cutting
from tests.deploy.small_release import package_of

CUTS, CUTS_LONG = 10, 150
MakeRelease = Callable[..., Path]


@pytest.fixture(scope="module")
def second(make_release: MakeRelease) -> Path:
    return make_release("2.0.0", extra_unit="bunraku-new.service")


@pytest.fixture(scope="module")
def count(with_first_release: BoxRoot, second: Path, tmp_path_factory: pytest.TempPathFactory) -> int:
    """How many changes of files an installation that nothing disturbs consists of."""
    folder = tmp_path_factory.mktemp("counted")
    box = BoxRoot(folder / "box").copy_of(with_first_release)
    try:
        log = folder / "log" / "count"
        log.parent.mkdir()
        taken(box, second, env=cutting(box, "count", log))
        assert box.current == "2.0.0"
    finally:
        box.switch_off()
    return changes(log)


@pytest.fixture
def own(with_first_release: BoxRoot, tmp_path: Path) -> Iterator[BoxRoot]:
    box = BoxRoot(tmp_path / "box").copy_of(with_first_release)
    yield box
    box.switch_off()


def test_before_every_single_change_the_box_would_start(own: BoxRoot, second: Path, tmp_path: Path) -> None:
    log = tmp_path / "log" / "changes"
    log.parent.mkdir()
    watching = cutting(own, "watch", log)
    taken(own, second, env=watching)
    assert own.release("back", env=watching).returncode == 0
    assert not log.exists(), log.read_text()
    assert own.dpkg("--remove", "bunraku", env=watching).returncode == 0
    assert log.exists(), "the watch sees a box that would not start"


def test_cut_at_any_change_the_box_has_one_whole_release(
    with_first_release: BoxRoot, second: Path, count: int, tmp_path: Path, *, long_run: bool
) -> None:
    cuts = min(count, CUTS_LONG if long_run else CUTS)
    for cut in range(1, cuts + 1):
        at = count * cut // cuts
        box = BoxRoot(tmp_path / f"box-{cut}").copy_of(with_first_release)
        try:
            log = tmp_path / f"log-{cut}" / "count"
            log.parent.mkdir()
            taken_then_cut = box.release("install", second, env=cutting(box, at, log))
            assert taken_then_cut.returncode != 0 or at >= count - 2, f"it was cut at {at}"
            box.switch_off()
            assert box.check_disk() in (0, 1)
            box.switch_on()
            version = box.current
            assert version in ("1.0.0", "2.0.0"), at
            assert box.run("/usr/bin/bunraku") == f"bunraku {version}\n"
            assert f"version {version}" in box.run("cat", "/usr/lib/systemd/system/bunraku.target")
            _goes_on(box, second)
        finally:
            box.switch_off()


def test_what_was_installed_is_on_the_disk_when_dpkg_says_so(own: BoxRoot, second: Path) -> None:
    assert own.dpkg("--install", package_of(second)).returncode == 0
    own.cut_power()
    assert own.check_disk() in (0, 1)
    own.switch_on()
    assert own.run("/usr/bin/bunraku") == "bunraku 2.0.0\n"


def _goes_on(box: BoxRoot, release: Path) -> None:
    """Once more after the cut: it installs as if nothing had happened."""
    taken(box, release)
    assert box.run("/usr/bin/bunraku") == "bunraku 2.0.0\n"
    assert sorted(path.name for path in box.releases.iterdir()) == ["1.0.0", "2.0.0"]
    assert box.dpkg("--audit").stdout == ""
