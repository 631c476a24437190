"""What a stick may hold instead of a release: nothing of it is installed, and nothing stops the box."""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot, refused, taken
from tests.deploy.small_release import write_sums

MakeRelease = Callable[..., Path]
SECRET = "only root may read this"


def test_files_that_no_signature_covers_are_not_installed(box: BoxRoot, make_release: MakeRelease) -> None:
    release = make_release("1.1.0")
    for name in ("wheels/more-1.0-py3-none-any.whl", "system/usr/lib/systemd/system/more.service", "more"):
        (release / name).write_text("laid beside the release\n")
    taken(box, release)
    assert [path for path in box.releases.rglob("*more*") if "site-packages" not in path.parts] == []
    assert not (box.path / "usr/lib/systemd/system/more.service").is_symlink()


def a_pipe(file: Path) -> None:
    os.mkfifo(file)


def a_device_without_an_end(file: Path) -> None:
    os.mknod(file, stat.S_IFCHR | 0o600, os.makedev(1, 5))


def a_file_larger_than_the_disk(file: Path) -> None:
    with file.open("wb") as grown:
        grown.truncate(1 << 40)


@pytest.mark.parametrize(
    "put", [a_pipe, a_device_without_an_end, a_file_larger_than_the_disk], ids=lambda one: one.__name__
)
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("unneeded.txt", "files of the release are damaged"),
        ("release", "Copy "),
        ("SHA256SUMS", "Copy "),
        ("SHA256SUMS.sig", ". Nothing was changed."),
    ],
)
def test_what_is_no_file_of_a_release_neither_stops_the_installer_nor_fills_the_disk(
    box: BoxRoot, make_release: MakeRelease, put: Callable[[Path], None], name: str, words: str
) -> None:
    release = make_release("1.1.0")
    (release / name).unlink()
    put(release / name)
    if name in ("release", "SHA256SUMS") and put is not a_file_larger_than_the_disk:
        words = "no release in"
    assert words in refused(box, release)


@pytest.mark.parametrize(
    ("after", "harmed", "fails"),
    [
        ("ssh-keygen", "unneeded.txt", True),
        ("ssh-keygen", "release", True),
        ("ssh-keygen", "keys", True),
        ("ssh-keygen", "SHA256SUMS", False),
        ("sha256sum --check --strict --quiet", "install.sh", False),
    ],
)
def test_a_stick_that_changes_after_it_was_checked_brings_only_what_was_signed(
    box: BoxRoot, make_release: MakeRelease, tmp_path: Path, *, after: str, harmed: str, fails: bool
) -> None:
    release = make_release("1.1.0")
    signed = (release / harmed).read_bytes()
    hook = tmp_path / "first" / after.split()[0]
    hook.parent.mkdir()
    hook.write_text(
        f'#!/bin/bash\n{shutil.which(hook.name)} "$@"\nstatus=$?\n'
        f"case \"{hook.name} $*\" in '{after}'*) echo changed >>'{release / harmed}' ;; esac\nexit $status\n"
    )
    hook.chmod(0o755)
    done = box.install(release, env={"PATH": f"{hook.parent}:{os.environ['PATH']}"})
    assert (release / harmed).read_bytes() != signed
    if fails:
        assert done.returncode == 1 and "files of the release are damaged" in done.stderr
        assert box.current == "1.0.0"
    else:
        assert done.returncode == 0, done.stderr
        assert (box.releases / "1.1.0" / harmed).read_bytes() == signed


def a_path_upwards(release: Path, secret: Path) -> None:
    _list(release, f"./wheels/../../{secret.name}", secret)


def a_whole_path(release: Path, secret: Path) -> None:
    _list(release, str(secret), secret)


def a_link(release: Path, secret: Path) -> None:
    (release / "wheels/secret").symlink_to(secret)
    _list(release, "./wheels/secret", secret)


def a_folder_that_is_a_link(release: Path, secret: Path) -> None:
    (release / "more").symlink_to(secret.parent)
    _list(release, f"./more/{secret.name}", secret)


def _list(release: Path, name: str, file: Path) -> None:
    """With the right sum: who tries this may know what is in the file, or be after its rights alone."""
    shutil.copy(file, release / "copy")
    write_sums(release)
    (release / "copy").unlink()
    sums = (release / "SHA256SUMS").read_text()
    (release / "SHA256SUMS").write_text(sums.replace("./copy", name))


@pytest.mark.parametrize(
    "lead", [a_path_upwards, a_whole_path, a_link, a_folder_that_is_a_link], ids=lambda one: one.__name__
)
def test_a_stick_that_leads_out_of_its_folder_gets_no_copy_of_a_private_file(
    box: BoxRoot, make_release: MakeRelease, lead: Callable[[Path, Path], None]
) -> None:
    release = make_release("1.1.0")
    secret = release.parent / "secret"
    secret.write_text(SECRET)
    secret.chmod(0o600)
    lead(release, secret)
    assert "leads out of its folder" in refused(box, "--unsigned", release)
    copies = [path for path in box.written.rglob("*") if path.is_file() and path.name == secret.name]
    assert copies == []
