"""Whose releases a box takes: those of the keys that its own release names."""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot, refused, taken
from tests.deploy.image_box import ImageBox
from tests.deploy.small_release import fingerprint, make_key, package_of, sign

MakeRelease = Callable[..., Path]


@pytest.fixture
def stranger(tmp_path: Path) -> Path:
    return make_key(tmp_path / "strange", "stranger")


def signature_of(package: Path) -> Path:
    return package.with_name(package.name + ".sig")


def without_signature(package: Path, maker: Path, other: Path) -> None:
    signature_of(package).unlink()


def signed_for_something_else(package: Path, maker: Path, other: Path) -> None:
    """The maker's key has signed this very package, but as an e-mail."""
    sign(package, maker, "email")


def of_another_release(package: Path, maker: Path, other: Path) -> None:
    shutil.copy(signature_of(other), signature_of(package))


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (without_signature, "is not signed: anybody could have made it. Nothing was changed."),
        (signed_for_something_else, "is not what its maker signed. Nothing was changed."),
        (of_another_release, "is not what its maker signed. Nothing was changed."),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_a_release_that_its_maker_did_not_sign_so_is_refused_unless_told(
    box: BoxRoot, make_release: MakeRelease, maker: Path, harm: Callable[..., None], message: str
) -> None:
    package = package_of(make_release("1.1.0"))
    harm(package, maker, package_of(make_release("1.2.0")))
    assert message in refused(box, package)
    assert "Whoever wrote the stick will have this box" in taken(box, "--unsigned", package)
    assert box.current == "1.1.0"


def test_a_release_of_a_stranger_is_refused_and_its_key_named(
    box: BoxRoot, make_release: MakeRelease, stranger: Path
) -> None:
    said = refused(box, make_release("1.1.0", key=stranger))
    assert f"signed with the key {fingerprint(stranger)}, which this box does not know" in said


def test_an_unsigned_release_has_no_say_in_whose_releases_come_after_it(
    box: BoxRoot, make_release: MakeRelease, stranger: Path
) -> None:
    taken(box, "--unsigned", make_release("1.1.0", key=None))
    assert "which this box does not know" in refused(box, make_release("1.2.0", key=stranger))
    taken(box, make_release("1.2.0"))


def test_a_box_without_a_key_says_whose_it_will_keep_to(
    box: BoxRoot, make_release: MakeRelease, maker: Path, stranger: Path
) -> None:
    (box.releases / "1.0.0/keys").unlink()
    ours = "--key", fingerprint(maker)
    said = refused(box, *ours, make_release("1.1.0", key=stranger))
    assert f"signed with the key {fingerprint(stranger)}, not with {fingerprint(maker)}" in said
    assert "--key needs the key's fingerprint" in refused(box, "--key", "SHA256:short")
    said = taken(box, make_release("1.1.0"))
    assert f"knows no key yet. This release is signed with the key {fingerprint(maker)}" in said
    assert "which this box does not know" in refused(box, make_release("1.2.0", key=stranger))
    assert "knows no key" not in taken(box, make_release("1.2.0"))


def test_a_release_brings_the_key_of_those_after_it(
    box: BoxRoot, make_release: MakeRelease, tmp_path: Path
) -> None:
    new = make_key(tmp_path / "keys", "new")
    between = make_release("1.1.0", next_key=new)
    later = make_release("1.2.0", key=new)
    refused(box, later)
    taken(box, between)
    taken(box, later)
    assert "which this box does not know" in refused(box, make_release("1.3.0"))


def test_a_key_that_was_lost_is_replaced_by_its_fingerprint(
    box: BoxRoot, make_release: MakeRelease, stranger: Path
) -> None:
    release = make_release("1.1.0", key=stranger)
    said = refused(box, release)
    taken(box, *said.split("then: ")[1].split(), release)
    taken(box, make_release("1.2.0", key=stranger))


def test_a_box_whose_root_forgets_keeps_to_its_key(
    with_first_release: BoxRoot, make_release: MakeRelease, stranger: Path, tmp_path: Path
) -> None:
    box = ImageBox(tmp_path / "box", image=with_first_release)
    try:
        box.make()
        assert "which this box does not know" in refused(box, make_release("1.1.0", key=stranger))
        release = make_release("2.0.0", key=stranger)
        taken(box, "--key", fingerprint(stranger), release)
        box.cut_power()
        box.switch_on()
        assert box.current == "2.0.0"
        assert "which this box does not know" in refused(box, make_release("3.0.0"))
        taken(box, make_release("3.0.0", key=stranger))
    finally:
        box.switch_off()


@pytest.mark.parametrize("unsigned", [False, True], ids=["signed", "unsigned"])
def test_an_older_release_is_taken_only_when_that_is_said(
    box: BoxRoot, make_release: MakeRelease, *, unsigned: bool
) -> None:
    arguments = ["--unsigned"] if unsigned else []
    taken(box, make_release("1.10.0"))
    older = make_release("1.9.0")
    said = refused(box, *arguments, older)
    assert "bunraku 1.9.0, which is older than 1.10.0, which dances. Nothing was changed" in said
    taken(box, *arguments, "--older", older)
    assert box.current == "1.9.0"


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
