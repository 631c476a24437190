"""What a stick may hold instead of a release: nothing of it is installed, and nothing stops the box."""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot, refused
from tests.deploy.small_release import package_of

MakeRelease = Callable[..., Path]


def a_pipe(file: Path) -> None:
    os.mkfifo(file)


def a_device_without_an_end(file: Path) -> None:
    os.mknod(file, stat.S_IFCHR | 0o600, os.makedev(1, 5))


def a_file_larger_than_the_disk(file: Path) -> None:
    with file.open("wb") as grown:
        grown.truncate(1 << 40)


def a_link_to_what_only_root_may_read(file: Path) -> None:
    secret = file.parent / "secret"
    secret.write_text("only root may read this")
    secret.chmod(0o600)
    file.symlink_to(secret)


@pytest.mark.parametrize(
    "put",
    [a_pipe, a_device_without_an_end, a_file_larger_than_the_disk, a_link_to_what_only_root_may_read],
    ids=lambda one: one.__name__,
)
@pytest.mark.parametrize("name", ["", ".sig"], ids=["package", "signature"])
def test_what_is_no_package_neither_stops_the_box_nor_fills_its_disk(
    box: BoxRoot, make_release: MakeRelease, put: Callable[[Path], None], name: str
) -> None:
    package = package_of(make_release("1.1.0"))
    file = package.with_name(package.name + name)
    file.unlink()
    put(file)
    assert "Nothing was changed." in refused(box, package)
    assert box.run("/usr/bin/bunraku") == "bunraku 1.0.0\n"
    assert not [one for one in box.written.rglob("*") if one.is_file() and "only root may" in _head(one)]


def _head(path: Path) -> str:
    with path.open("rb") as stream:
        return stream.read(100).decode(errors="replace")


def test_a_stick_that_changes_after_it_was_checked_brings_only_what_was_signed(
    box: BoxRoot, make_release: MakeRelease, tmp_path: Path
) -> None:
    stick, foreign = (
        make_release("1.1.0"),
        package_of(make_release("1.1.0", extra_unit="bunraku-new.service")),
    )
    hook = tmp_path / "first" / "ssh-keygen"
    hook.parent.mkdir()
    swap = f"cp {foreign} {package_of(stick)}"
    hook.write_text(f'#!/bin/bash\n{shutil.which("ssh-keygen")} "$@"\nstatus=$?\n{swap}\nexit $status\n')
    hook.chmod(0o755)
    for path in (hook.parent, foreign.parent):
        box.lend(path)
    done = box.release("install", stick, env={"PATH": f"{hook.parent}:/usr/sbin:/usr/bin:/sbin:/bin"})
    assert done.returncode == 0, done.stderr
    assert package_of(stick).read_bytes() == foreign.read_bytes(), "the stick did change"
    assert box.current == "1.1.0"
    assert not (box.path / "usr/lib/systemd/system/bunraku-new.service").is_symlink()
