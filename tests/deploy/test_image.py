"""bunraku-release on a box made from the image: its releases lie on the data partition; its root forgets."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot
from tests.deploy.cutting import changes, cutting
from tests.deploy.image_box import ImageBox

MakeRelease = Callable[..., Path]
UNITS = "usr/lib/systemd/system"
CUTS = 5
SERVICE = 990


@pytest.fixture(scope="module")
def second(make_release: MakeRelease) -> Path:
    return make_release("2.0.0", extra_unit="bunraku-new.service")


@pytest.fixture
def fresh(with_first_release: BoxRoot, tmp_path: Path) -> Iterator[ImageBox]:
    """A box made from an image that came with release 1.0.0; nothing was ever installed on it."""
    own = ImageBox(tmp_path / "box", image=with_first_release)
    try:
        own.make()
        yield own
    finally:
        own.switch_off()


@pytest.fixture(scope="module")
def with_second(
    with_first_release: BoxRoot, second: Path, tmp_path_factory: pytest.TempPathFactory
) -> ImageBox:
    """Such a box on which release 2.0.0 was installed, switched off: its disk is to be copied."""
    box = ImageBox(tmp_path_factory.mktemp("second"), image=with_first_release)
    box.make()
    try:
        done = box.release("install", second)
    finally:
        box.switch_off()
    assert done.returncode == 0, done.stderr
    return box


@pytest.fixture
def box(with_second: ImageBox, tmp_path: Path) -> Iterator[ImageBox]:
    """A box made from the image, on whose data partition release 2.0.0 was installed."""
    own = ImageBox(tmp_path / "box", image=with_second.image)
    try:
        own.copy_of(with_second)
        yield own
    finally:
        own.switch_off()


def again(box: ImageBox) -> None:
    """It is switched off and on."""
    box.switch_off()
    assert box.check_disk() in (0, 1)
    box.switch_on()


def dances(box: ImageBox, version: str) -> None:
    """This release and no other, with what systemd reads of it."""
    assert box.current == version
    assert box.run("/usr/bin/bunraku") == f"bunraku {version}\n"
    assert f"version {version}" in box.run("cat", f"/{UNITS}/bunraku.target")
    assert (box.path / "etc/chrony/conf.d/bunraku.conf").read_text() == "# of 1.0.0\n", "the image's"
    for unit, only_in in (("bunraku-old.service", "1.0.0"), ("bunraku-new.service", "2.0.0")):
        assert (box.call("test", "-e", f"/{UNITS}/{unit}").returncode == 0) == (version == only_in)


def test_what_was_installed_dances_after_each_power_on(fresh: ImageBox, second: Path) -> None:
    done = fresh.release("install", second)
    assert done.returncode == 0, done.stderr
    for _ in range(2):
        dances(fresh, "2.0.0")
        assert fresh.release("list").stdout == "  1.0.0\n* 2.0.0\n"
        fresh.cut_power()
        assert fresh.check_disk() in (0, 1)
        fresh.switch_on()
    assert not (fresh.path / "opt/bunraku/releases/1.0.0").is_symlink(), "what came with the image stays"
    assert [path.name for path in fresh.releases.iterdir() if path.is_dir() and not path.is_symlink()] == [
        "2.0.0"
    ]


def test_it_goes_back_and_forth_for_good(box: ImageBox) -> None:
    for arguments, version in (("back", "1.0.0"), ("use 2.0.0", "2.0.0"), ("use 1.0.0", "1.0.0")):
        done = box.release(*arguments.split())
        assert done.returncode == 0, done.stderr
        dances(box, version)
        box.cut_power()
        box.switch_on()
        dances(box, version)
    assert box.release("list").stdout == "* 1.0.0\n  2.0.0\n"


def test_what_came_with_the_image_is_never_taken_away(box: ImageBox, make_release: MakeRelease) -> None:
    for version in ("3.0.0", "4.0.0", "5.0.0"):
        assert box.release("install", make_release(version)).returncode == 0
    assert box.release("list").stdout == "  1.0.0\n  3.0.0\n  4.0.0\n* 5.0.0\n"
    assert not (box.releases / "2.0.0").exists()
    again(box)
    assert box.release("list").stdout == "  1.0.0\n  3.0.0\n  4.0.0\n* 5.0.0\n"


def test_a_trial_is_forgotten(box: ImageBox, make_release: MakeRelease) -> None:
    assert box.release("install", "--until-power-off", make_release("3.0.0")).returncode == 0
    assert box.current == "3.0.0"
    again(box)
    dances(box, "2.0.0")
    assert box.release("list").stdout == "  1.0.0\n* 2.0.0\n"


def _truncated(release: Path) -> None:
    part = next(release.glob("lib/python3*/site-packages/appliance/start.py"))
    part.write_bytes(part.read_bytes()[:-1])


def _other_unit(release: Path) -> None:
    unit = release / "system" / UNITS / "bunraku.target"
    unit.write_text(unit.read_text().replace("Unit", "unit"))


def _whole(release: Path) -> None:
    (release / "whole").unlink()


def _service_owns(name: str) -> Callable[[Path], None]:
    return lambda release: os.chown(release / name, SERVICE, SERVICE)


def _all_may_write(name: str) -> Callable[[Path], None]:
    return lambda release: (release / name).chmod(0o777)


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (_truncated, "files of it are missing or damaged"),
        (lambda release: (release / "bin/bunraku").unlink(), "files of it are missing or damaged"),
        (_service_owns("bin/bunraku"), "files of it are missing or damaged"),
        (_all_may_write("bin"), "files of it are missing or damaged"),
        (_all_may_write("."), "others than root may write there"),
        (_service_owns(".."), "others than root may write there"),
        (_all_may_write("../.."), "others than root may write there"),
        (_other_unit, "files of it are missing or damaged"),
        (_whole, "it is not whole"),
    ],
)
def test_a_damaged_release_gives_way_to_the_one_that_came_with_the_image(
    box: ImageBox, second: Path, harm: Callable[[Path], None], message: str
) -> None:
    place, modes = box.releases / "2.0.0", [path.stat() for path in (box.written, box.releases)]
    harm(place)
    again(box)
    dances(box, "1.0.0")
    assert box.next_choice is None, "it is not tried again at each power-on"
    assert f"2.0.0  put aside: {message}" in box.release("list").stdout or message == "it is not whole"
    for path, stat in zip((box.written, box.releases), modes, strict=True):
        path.chmod(stat.st_mode & 0o777)
        os.chown(path, stat.st_uid, stat.st_gid)
    if message != "others than root may write there":
        assert box.release("use", "2.0.0").returncode == 1
    done = box.release("install", second)
    assert done.returncode == 0, done.stderr
    again(box)
    dances(box, "2.0.0")


@pytest.mark.parametrize(
    ("fact", "message"), [("architecture s390x", "it is for s390x"), ("python 3.99", "it needs Python 3.99")]
)
def test_a_release_for_another_machine_gives_way(box: ImageBox, fact: str, message: str) -> None:
    """As on a disk that came from another box; all its sums are right."""
    place = box.releases / "2.0.0"
    facts = (place / "release").read_text().splitlines()
    name = fact.split()[0]
    (place / "release").write_text(
        "\n".join(fact if line.startswith(name) else line for line in facts) + "\n"
    )
    box.run("sh", "-c", f"cd /data/bunraku-releases/2.0.0 && {_SEAL}")
    again(box)
    dances(box, "1.0.0")
    assert message in box.release("list").stdout


def test_a_release_that_never_comes_to_dance_is_not_tried_for_ever(box: ImageBox) -> None:
    """Here nothing dances: each power-on counts, as on a box that crashes before its stage has danced."""
    for _ in range(4):
        again(box)
        dances(box, "2.0.0")
    again(box)
    dances(box, "1.0.0")
    assert "put aside: it did not dance for 5 s in 5 power-ons" in box.release("list").stdout
    assert box.release("use", "2.0.0").returncode == 0
    assert "put aside" not in box.release("list").stdout
    again(box)
    dances(box, "2.0.0")


def test_where_others_than_root_may_write_nothing_is_installed(fresh: ImageBox, second: Path) -> None:
    fresh.written.chmod(0o777)
    done = fresh.release("install", second)
    assert done.returncode == 1
    assert "what lies there would be started as root" in done.stderr
    assert list(fresh.releases.iterdir()) == []


def test_a_data_partition_that_cannot_be_written_is_said(fresh: ImageBox, second: Path) -> None:
    fresh.remount_data("ro")
    done = fresh.release("install", second)
    assert done.returncode == 1
    assert "bunraku-releases cannot be written. Nothing was changed." in done.stderr


@pytest.mark.parametrize("message", ["install", "back"])
@pytest.mark.parametrize("cut", range(1, CUTS + 1))
def test_cut_at_any_change_one_whole_release_dances_at_the_next_power_on(
    box: ImageBox, make_release: MakeRelease, tmp_path: Path, message: str, cut: int
) -> None:
    command = ("install", make_release("3.0.0")) if message == "install" else (message,)
    count = _changes(box, command, tmp_path)
    log = tmp_path / "log" / "count"
    log.parent.mkdir()
    done = box.release(*command, env=cutting(box, count * cut // CUTS, log))
    assert done.returncode != 0 or cut == CUTS, "it was cut"
    box.switch_off()
    assert box.check_disk() in (0, 1)
    box.switch_on()
    version = box.current
    assert version in (("2.0.0", "3.0.0") if message == "install" else ("2.0.0", "1.0.0"))
    assert version is not None
    dances(box, version)
    if version == "2.0.0":
        assert box.release(*command).returncode == 0, "once more: as if nothing had happened"


_counted: dict[str, int] = {}


def _changes(box: ImageBox, command: tuple[str | Path, ...], tmp_path: Path) -> int:
    """How many changes of files this consists of when nothing disturbs it; counted once, on another box."""
    key = str(command[0])
    if key not in _counted:
        box.switch_off()
        other = ImageBox(tmp_path / "counted", image=box.image)
        other.copy_of(box)
        log = tmp_path / "counting" / "count"
        log.parent.mkdir()
        try:
            done = other.release(*command, env=cutting(other, "count", log))
        finally:
            other.switch_off()
        assert done.returncode == 0, done.stderr
        _counted[key] = changes(log)
        box.switch_on()
    return _counted[key]


_LISTED = r"\( -type d -printf 'd %m %U %P\n' -o -printf '%y %m %U %s %P %l\n' \)"
_SEAL = (
    f"{{ find . -mindepth 1 -not -name whole {_LISTED}; "
    "find system release bunraku-release -type f -exec sha256sum {} +; } | LC_ALL=C sort >whole"
)
