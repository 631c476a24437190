"""install.sh: side by side, one switch, back again; without a network and into a root of the test's own."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot, python
from tests.deploy.small_release import INSTALL, sign, write_facts

MakeRelease = Callable[..., Path]
UNITS = "usr/lib/systemd/system"
CLOCK = "etc/chrony/conf.d/bunraku.conf"


def test_a_release_is_unpacked_beside_the_one_before_and_switched_to(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    done = box.install(make_release("1.1.0"))
    assert done.returncode == 0, done.stderr
    assert box.run("/usr/local/bin/bunraku") == "bunraku 1.1.0\n"
    assert box.install("--list").stdout == "  1.0.0\n* 1.1.0\n"
    assert "version 1.1.0" in box.run("cat", f"/{UNITS}/bunraku.target")
    assert (box.path / CLOCK).read_text() == "# of 1.1.0\n"


def test_it_brings_bytecode_that_names_the_final_folder_and_leaves_out_what_nobody_loads(
    box: BoxRoot,
) -> None:
    packages = next((box.releases / "1.0.0/lib").glob("python3*")) / "site-packages"
    assert not (packages / "appliance/unneeded").exists()
    compiled = next((packages / "appliance/__pycache__").glob("start.*.pyc")).read_bytes()
    assert str(packages).removeprefix(str(box.path)).encode() in compiled
    assert b".part" not in compiled


def test_the_box_starts_with_the_machine(box: BoxRoot) -> None:
    wanted = box.path / "etc/systemd/system/multi-user.target.wants/bunraku.target"
    assert wanted.readlink() == Path(f"/{UNITS}/bunraku.target")


def test_system_files_come_and_go_with_the_release(box: BoxRoot, make_release: MakeRelease) -> None:
    old = box.path / UNITS / "bunraku-old.service"
    assert old.is_symlink()
    assert box.install(make_release("1.1.0", extra_unit="bunraku-new.service")).returncode == 0
    assert not old.is_symlink()
    assert "Only in this" in box.run("cat", f"/{UNITS}/bunraku-new.service")
    assert box.install("--rollback").returncode == 0
    assert "Only in this" in box.run("cat", f"/{UNITS}/bunraku-old.service")
    assert not (box.path / UNITS / "bunraku-new.service").is_symlink()
    assert (box.path / CLOCK).read_text() == "# of 1.0.0\n"


def test_what_a_technician_changed_stays(box: BoxRoot, make_release: MakeRelease) -> None:
    (box.path / CLOCK).write_text("# mine\n")
    done = box.install(make_release("1.1.0"))
    assert done.returncode == 0
    assert f"/{CLOCK} was changed on this box and stays" in done.stdout
    assert (box.path / CLOCK).read_text() == "# mine\n"


def test_two_releases_before_the_current_one_stay_and_each_can_be_used(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    for version in ("0.9.0", "1.2.0", "1.10.0"):  # the order of installation counts, not the number
        assert box.install("--older", make_release(version)).returncode == 0
    assert box.install("--list").stdout == "  0.9.0\n  1.2.0\n* 1.10.0\n"
    assert box.install("--rollback").returncode == 0
    assert box.current == "1.2.0"
    assert box.install("--use", "0.9.0").returncode == 0
    assert box.run("/usr/local/bin/bunraku") == "bunraku 0.9.0\n"
    refused = box.install("--rollback")
    assert refused.returncode == 1
    assert "no release before 0.9.0" in refused.stderr
    assert "It has: 0.9.0 1.2.0 1.10.0" in box.install("--use", "7.0.0").stderr


def test_the_same_version_with_another_content_lies_beside_it(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    other = make_release("1.0.0", extra_unit="bunraku-new.service")
    assert box.install(other).returncode == 0
    assert box.current is not None and box.current.startswith("1.0.0-")
    before = sorted(path.name for path in box.releases.iterdir())
    assert box.install(other).returncode == 0, "once more: nothing new to unpack"
    assert sorted(path.name for path in box.releases.iterdir()) == before


def test_a_damaged_file_on_the_stick_is_refused(box: BoxRoot, make_release: MakeRelease) -> None:
    release = make_release("1.1.0")
    wheel = next((release / "wheels").iterdir())
    content = bytearray(wheel.read_bytes())
    content[100] ^= 1
    wheel.write_bytes(content)
    done = box.install(release)
    assert done.returncode == 1
    assert wheel.name in done.stderr and "damaged" in done.stderr
    _is_untouched(box)


def test_a_stick_that_is_pulled_is_said(box: BoxRoot, make_release: MakeRelease) -> None:
    release = make_release("1.1.0")
    shutil.rmtree(release / "wheels")
    done = box.install(release)
    assert done.returncode == 1
    assert "Is the stick still in?" in done.stderr
    _is_untouched(box)


def test_a_release_that_does_not_work_is_refused(box: BoxRoot, make_release: MakeRelease) -> None:
    done = box.install(make_release("1.1.0", broken=True))
    assert done.returncode == 1
    assert "a part is missing" in done.stderr
    assert "bunraku 1.1.0 does not work on this box (above). The box dances as before." in done.stderr
    _is_untouched(box)


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({"arch": "s390x"}, "the release is for s390x. Take the release for"),
        ({"python": "3.99"}, "Python 3.99 is missing. Bunraku is made for Debian 13"),
        ({"needs_mb": 999_999_999}, "999999999 MB are needed. Nothing was changed."),
    ],
)
def test_a_machine_that_does_not_fit_is_refused(
    box: BoxRoot, make_release: MakeRelease, maker: Path, facts: dict[str, str], words: str
) -> None:
    release = make_release("1.1.0")
    write_facts(release, **{"version": "1.1.0", "python": str(python()), **facts})  # type: ignore[arg-type]
    sign(release, maker)
    done = box.install(release)
    assert done.returncode == 1
    assert words in done.stderr
    _is_untouched(box)


def test_a_folder_without_a_release_is_said(box: BoxRoot, tmp_path: Path) -> None:
    done = box.install(tmp_path)
    assert done.returncode == 1
    assert f"no release in {tmp_path}" in done.stderr
    assert "unknown option '--again'. See install.sh --help." in box.install("--again").stderr


def test_a_root_that_is_not_there_is_never_taken_for_this_machine(tmp_path: Path) -> None:
    command = ("bash", str(INSTALL), "--uninstall", "--root", str(tmp_path / "nowhere"))
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert "there is no folder" in done.stderr


def test_uninstalled_nothing_points_to_it_and_shows_stay_until_purged(box: BoxRoot) -> None:
    show = box.path / "data/bunraku/shows/tonight/show.yaml"
    show.parent.mkdir(parents=True)
    show.write_text("name: tonight\n")
    assert box.install("--uninstall").returncode == 0
    assert not (box.path / "opt/bunraku").exists()
    assert not (box.path / CLOCK).exists()
    left = [
        path
        for top in ("etc", "usr/lib/systemd", "usr/local")
        for path in (box.path / top).rglob("*bunraku*")
    ]
    assert left == []
    assert show.exists()
    done = box.install("--uninstall", "--purge")
    assert done.returncode == 0, done.stderr
    assert not (box.path / "data/bunraku").exists()


def test_a_root_without_shared_memory_is_refused_before_anything_is_unpacked(
    box: BoxRoot, make_release: MakeRelease
) -> None:
    shutil.rmtree(box.path / "dev/shm")
    done = box.install(make_release("1.1.0"))
    assert done.returncode == 1
    assert f"{box.path}/dev/shm is missing, or cannot be written" in done.stderr
    assert "unpacking" not in done.stdout
    (box.path / "dev/shm").mkdir()
    _is_untouched(box)


@pytest.fixture
def partition(box: BoxRoot, tmp_path: Path) -> Iterator[str]:
    """A disk with an ext4 file system, which is nowhere mounted afterwards."""
    disk = tmp_path / "data.ext4"
    with disk.open("wb") as made:
        made.truncate(32 << 20)
    subprocess.run(["mke2fs", "-q", "-t", "ext4", str(disk)], check=True)
    found = subprocess.check_output(["losetup", "--find", "--show", str(disk)], text=True).strip()
    yield found
    while subprocess.run(["umount", str(box.path / "data")], capture_output=True).returncode == 0:
        pass
    subprocess.run(["losetup", "--detach", found], check=True)


def test_data_gets_a_partition_that_keeps_what_was_there(box: BoxRoot, partition: str) -> None:
    keys = box.path / "data/bunraku/keys/sensors.keys"
    keys.parent.mkdir(parents=True)
    keys.write_text("left-wrist: {}\n")
    done = box.install("--data", partition)
    assert done.returncode == 0, done.stderr
    assert f"/data is on {partition} from now on" in done.stdout
    assert keys.read_text() == "left-wrist: {}\n"
    assert (box.path / "data").is_mount()
    (line,) = [one for one in (box.path / "etc/fstab").read_text().splitlines() if "/data" in one]
    assert line.startswith("UUID=") and "nofail" in line
    again = box.install("--data", partition)
    assert again.returncode == 1 and "has a partition already" in again.stderr


def test_a_partition_is_never_formatted_nor_guessed(box: BoxRoot, partition: str) -> None:
    before = (box.path / "etc/fstab").read_text() if (box.path / "etc/fstab").exists() else None
    assert "there is no partition '/dev/nowhere'" in box.install("--data", "/dev/nowhere").stderr
    subprocess.run(["dd", "if=/dev/zero", f"of={partition}", "bs=64k", "count=2", "status=none"], check=True)
    done = box.install("--data", partition)
    assert done.returncode == 1
    assert "no file system, ext4 is needed. Nothing was changed." in done.stderr
    assert f"mkfs.ext4 -L data {partition}" in done.stderr
    assert ((box.path / "etc/fstab").read_text() if before is not None else None) == before


@pytest.mark.parametrize(
    ("mounted", "memory"),
    [("tmpfs", "tmpfs"), ("overlay on tmpfs", "tmpfs"), ("overlay on a disk", ""), ("nothing", "")],
)
def test_a_place_in_memory_is_seen_for_what_it_is(tmp_path: Path, mounted: str, memory: str) -> None:
    data, above = tmp_path / "data", tmp_path / "above"
    for made in (data, above):
        made.mkdir()
    words = [f"source <(sed '/^main /d' '{INSTALL}')"]
    if mounted in ("tmpfs", "overlay on tmpfs"):
        words.append(f"mount -t tmpfs tmpfs {data if mounted == 'tmpfs' else above}")
    if mounted.startswith("overlay"):
        words.append(f"mkdir {above}/upper {above}/work")
        words.append(
            f"mount -t overlay -o lowerdir=/usr,upperdir={above}/upper,workdir={above}/work o {data}"
        )
    words.append(f"memory_of {data}/bunraku/keys")
    done = subprocess.run(
        ["unshare", "--mount", "bash", "-c", "; ".join(words)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, memory), done.stderr


@pytest.mark.parametrize(("memory", "status"), [("tmpfs", 1), ("", 0)])
def test_nothing_is_installed_on_a_box_that_would_forget_its_sensors(memory: str, status: int) -> None:
    words = f"source <(sed '/^main /d' '{INSTALL}'); memory_of() {{ echo {memory}; }}; check_lasts; exit 0"
    done = subprocess.run(["bash", "-c", words], capture_output=True, text=True, check=False)
    assert done.returncode == status
    assert ("/data is in memory (tmpfs): sensors' keys" in done.stderr) == bool(status)
    assert bool(done.stderr) == bool(status)


def _is_untouched(box: BoxRoot) -> None:
    assert box.run("/usr/local/bin/bunraku") == "bunraku 1.0.0\n"
    assert [path.name for path in box.releases.iterdir()] == ["1.0.0"]
