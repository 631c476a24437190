"""The plug is pulled while a release is installed: the box has the old release or the new one, whole."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot
from tests.deploy.cutting import cutting

CUTS = 8
MakeRelease = Callable[..., Path]


@pytest.fixture(scope="module")
def second(make_release: MakeRelease) -> Path:
    return make_release("2.0.0", extra_unit="bunraku-new.service")


@pytest.fixture(scope="module")
def commands(with_first_release: BoxRoot, second: Path, tmp_path_factory: pytest.TempPathFactory) -> int:
    """How many commands an installation that nothing disturbs consists of."""
    folder = tmp_path_factory.mktemp("counted")
    box = BoxRoot(folder / "box").copy_of(with_first_release)
    try:
        done = box.install(second, env=cutting(box, "count", folder / "count"))
        assert done.returncode == 0, done.stderr
        assert box.current == "2.0.0"
    finally:
        box.switch_off()
    return int((folder / "count").read_text())


@pytest.fixture
def own(with_first_release: BoxRoot, tmp_path: Path) -> Iterator[BoxRoot]:
    box = BoxRoot(tmp_path / "box").copy_of(with_first_release)
    yield box
    box.switch_off()


def test_before_every_single_command_the_box_would_start(own: BoxRoot, second: Path, tmp_path: Path) -> None:
    log = tmp_path / "commands"
    log.write_text("")
    for words in ((second,), ("--rollback",)):
        done = own.install(*words, env=cutting(own, "watch", log))
        assert done.returncode == 0, done.stderr
        assert log.read_text() == ""
    assert own.install("--uninstall", env=cutting(own, "watch", log)).returncode == 0
    assert log.read_text() != "", "the watch sees a box that would not start"


@pytest.mark.parametrize("cut", range(1, CUTS + 1))
def test_cut_at_any_command_the_box_has_one_whole_release(
    own: BoxRoot, second: Path, commands: int, tmp_path: Path, cut: int
) -> None:
    at = commands * cut // CUTS
    assert own.install(second, env=cutting(own, at, tmp_path / "count")).returncode != 0, "it was cut"
    own.switch_off()
    assert own.check_disk() in (0, 1)
    own.switch_on()
    version = own.current
    assert version in ("1.0.0", "2.0.0")
    assert own.run("/usr/local/bin/bunraku") == f"bunraku {version}\n"
    assert f"version {version}" in own.run("cat", "/usr/lib/systemd/system/bunraku.target")
    assert own.run("test", "-e", "/etc/systemd/system/multi-user.target.wants/bunraku.target") == ""
    if cut % 2 == 0:
        _goes_on(own, second)


def test_what_was_installed_is_on_the_disk_when_the_installer_says_so(own: BoxRoot, second: Path) -> None:
    assert own.install(second).returncode == 0
    own.cut_power()
    assert own.check_disk() in (0, 1)
    own.switch_on()
    assert own.run("/usr/local/bin/bunraku") == "bunraku 2.0.0\n"
    shutil.rmtree(own.releases / "1.0.0")
    assert own.run("/usr/local/bin/bunraku") == "bunraku 2.0.0\n", "nothing of it lies in the old one"


def _goes_on(box: BoxRoot, release: Path) -> None:
    """Once more after the cut: it installs as if nothing had happened."""
    done = box.install(release)
    assert done.returncode == 0, done.stderr
    assert box.run("/usr/local/bin/bunraku") == "bunraku 2.0.0\n"
    assert sorted(path.name for path in box.releases.iterdir()) == ["1.0.0", "2.0.0"]
    assert not list((box.path / "usr/lib/systemd/system").glob("*.new"))
