"""The package: side by side, one switch, back again, and off; without a network."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.deploy.box_root import BoxRoot, refused, taken
from tests.deploy.cutting import changes, cutting
from tests.deploy.small_release import CLOCK, UNITS, package_of

MakeRelease = Callable[..., Path]


def test_a_release_is_installed_beside_the_one_before_and_switched_to(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    taken(box, make_release("1.1.0"))
    assert box.run("/usr/bin/bunraku") == "bunraku 1.1.0\n"
    assert box.release("list").stdout == "  1.0.0\n* 1.1.0\n"
    assert "version 1.1.0" in box.run("cat", f"/{UNITS}/bunraku.target")
    assert (box.path / CLOCK).read_text() == "# of 1.1.0\n"
    assert "1.1.0" in box.dpkg("--status", "bunraku").stdout


def test_an_older_one_dances_again_with_its_own_units(box: BoxRoot, make_release: MakeRelease) -> None:
    old = box.path / UNITS / "bunraku-old.service"
    assert old.is_symlink()
    taken(box, make_release("1.1.0", extra_unit="bunraku-new.service"))
    assert not old.is_symlink()
    assert "Only in this" in box.run("cat", f"/{UNITS}/bunraku-new.service")
    assert box.release("back").returncode == 0
    assert "Only in this" in box.run("cat", f"/{UNITS}/bunraku-old.service")
    assert box.call("cat", f"/{UNITS}/bunraku-new.service").returncode != 0
    assert box.run("/usr/bin/bunraku") == "bunraku 1.0.0\n"


def test_what_a_technician_changed_stays(box: BoxRoot, make_release: MakeRelease) -> None:
    (box.path / CLOCK).write_text("# mine\n")
    taken(box, make_release("1.1.0"))
    assert (box.path / CLOCK).read_text() == "# mine\n"


def test_two_releases_before_the_current_one_stay_and_each_can_be_used(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    for version in ("0.9.0", "1.2.0", "1.10.0"):  # the order of installation counts, not the number
        taken(box, "--older", make_release(version))
    assert box.release("list").stdout == "  0.9.0\n  1.2.0\n* 1.10.0\n"
    assert box.release("back").returncode == 0
    assert box.current == "1.2.0"
    assert box.release("use", "0.9.0").returncode == 0
    assert box.run("/usr/bin/bunraku") == "bunraku 0.9.0\n"
    again = box.release("back")
    assert again.returncode == 1
    assert "no release before 0.9.0" in again.stderr
    assert "It has: 0.9.0 1.2.0 1.10.0" in box.release("use", "7.0.0").stderr


def test_the_same_version_with_another_content_lies_beside_it(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    other = make_release("1.0.0", extra_unit="bunraku-new.service")
    taken(box, other)
    assert box.current is not None and box.current.startswith("1.0.0-")
    before = sorted(path.name for path in box.releases.iterdir())
    taken(box, other)
    assert sorted(path.name for path in box.releases.iterdir()) == before, "once more: nothing new"


def test_a_package_for_another_processor_is_refused(box: BoxRoot, make_release: MakeRelease) -> None:
    stick = make_release("1.1.0", arch="s390x")
    assert "no bunraku_*_" in refused(box, stick)
    assert "no bunraku_*_" in refused(box, f"{stick}/"), "a folder named with a slash at its end"
    assert "this system does not take it (above). Nothing was changed." in refused(box, package_of(stick))


def test_a_folder_without_a_release_and_a_wrong_word_are_said(box: BoxRoot, tmp_path: Path) -> None:
    assert f" in {tmp_path}" in refused(box, tmp_path)
    assert "unknown option '--again'. See bunraku-release --help." in box.release("--again").stderr
    assert "unknown command 'bake'" in box.release("bake").stderr


def test_removed_and_purged_nothing_points_to_it_and_shows_stay(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    show = box.path / "data/bunraku/shows/tonight/show.yaml"
    show.parent.mkdir(parents=True)
    show.write_text("name: tonight\n")
    taken(box, make_release("1.1.0", extra_unit="bunraku-new.service"))
    assert box.release("back").returncode == 0
    done = box.dpkg("--remove", "bunraku")
    assert done.returncode == 0, done.stderr
    left = [*(box.written / "upper/usr").rglob("*bunraku*"), *(box.path / "opt").rglob("*bunraku*")]
    assert [path for path in left if not path.is_char_device()] == []
    assert (box.path / CLOCK).exists()
    assert box.dpkg("--purge", "bunraku").returncode == 0
    assert not (box.path / CLOCK).exists()
    assert show.exists()


@pytest.fixture
def partition(box: BoxRoot, tmp_path: Path) -> Iterator[str]:
    """A disk with an ext4 file system, which is nowhere mounted afterwards."""
    disk = tmp_path / "data.ext4"
    with disk.open("wb") as made:
        made.truncate(32 << 20)
    subprocess.run(["mke2fs", "-q", "-t", "ext4", str(disk)], check=True)
    found = subprocess.check_output(["losetup", "--find", "--show", str(disk)], text=True).strip()
    yield found
    subprocess.run(["losetup", "--detach", found], check=True)


def test_a_partition_becomes_data_with_what_was_there(box: BoxRoot, partition: str) -> None:
    """By the page's command and its line for fstab."""
    keys = box.path / "data/bunraku/keys/sensors.keys"
    keys.parent.mkdir(parents=True)
    keys.write_text("left-wrist: {}\n")
    (box.path / "mnt").mkdir(exist_ok=True)
    page = (ROOT / "docs/touring.md").read_text().partition("### A place that lasts")[2].split("`")
    copies = next(one for one in page if one.startswith("sudo mount")).replace("sudo ", "")
    line = next(one for one in page if one.startswith("UUID=..."))
    named = f"$(blkid -o export {partition} | grep ^UUID=)"
    said = f"{copies.replace('/dev/sda1', partition)}; echo {line.replace('UUID=...', named)} >/etc/fstab"
    done = box.call("sh", "-ec", f"rm -f /etc/fstab; {said}; mount /data; cat /data/bunraku/keys/*")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "left-wrist: {}\n"
    assert "nosuid" in box.call("sh", "-c", "mount /data; findmnt -n -o OPTIONS /data").stdout


CUTS, CUTS_LONG = 10, 150


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
