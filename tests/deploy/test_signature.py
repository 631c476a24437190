"""Whose releases a box takes: those of the keys that its own release names."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.deploy.box_root import BoxRoot, refused, taken
from tests.deploy.image_box import ImageBox
from tests.deploy.small_release import SIGN, fingerprint, make_key, sign, write_sums

MakeRelease = Callable[..., Path]


@pytest.fixture
def stranger(tmp_path: Path) -> Path:
    return make_key(tmp_path / "strange", "stranger")


@pytest.fixture
def bare(needs_roots: None, tmp_path: Path) -> Iterator[BoxRoot]:
    """A machine on which no release was ever installed."""
    own = BoxRoot(tmp_path / "bare")
    own.make()
    yield own
    own.switch_off()


def without_signature(release: Path) -> None:
    (release / "SHA256SUMS.sig").unlink()


def signed_for_something_else(release: Path) -> None:
    """The maker's key has signed these very sums, but as an e-mail."""
    (release / "SHA256SUMS.sig").unlink()
    command = ["ssh-keygen", "-Y", "sign", "-f", release.parent / "maker", "-n", "email"]
    subprocess.run([*command, release / "SHA256SUMS"], check=True, stderr=subprocess.DEVNULL)


def changed_after_signing(release: Path) -> None:
    (release / "unneeded.txt").write_text("# anything\n")
    write_sums(release)


def of_another_release(release: Path) -> None:
    changed_after_signing(release)
    sign(release, release.parent / "maker")
    signature = (release / "SHA256SUMS.sig").read_bytes()
    (release / "install.sh").write_text("#!/bin/bash\n")
    write_sums(release)
    (release / "SHA256SUMS.sig").write_bytes(signature)


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (without_signature, "is not signed: anybody could have made it. Nothing was changed."),
        (signed_for_something_else, "is not what its maker signed. Nothing was changed."),
        (changed_after_signing, "is not what its maker signed. Nothing was changed."),
        (of_another_release, "is not what its maker signed. Nothing was changed."),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
@pytest.mark.parametrize("on", ["a box", "a bare machine"])
def test_a_release_that_its_maker_did_not_sign_so_is_refused_unless_told(
    *,
    box: BoxRoot,
    bare: BoxRoot,
    on: str,
    make_release: MakeRelease,
    maker: Path,
    harm: Callable[[Path], None],
    words: str,
) -> None:
    machine = box if on == "a box" else bare
    release = make_release("1.1.0")
    for half in (maker, maker.with_suffix(".pub")):
        shutil.copy(half, release.parent)
    harm(release)
    assert words in refused(machine, release)
    assert "Whoever wrote the stick will have this box" in taken(machine, "--unsigned", release)
    assert machine.current == "1.1.0"


def test_a_release_of_a_stranger_is_refused_and_its_key_named(
    box: BoxRoot, make_release: MakeRelease, stranger: Path
) -> None:
    said = refused(box, make_release("1.1.0", key=stranger))
    assert f"signed with the key {fingerprint(stranger)}, which this box does not know" in said


def test_an_unsigned_release_has_no_say_in_whose_releases_come_after_it(
    box: BoxRoot, make_release: MakeRelease, stranger: Path
) -> None:
    taken(box, "--unsigned", make_release("1.1.0", key=stranger))
    assert "which this box does not know" in refused(box, make_release("1.2.0", key=stranger))
    taken(box, make_release("1.2.0"))


def test_a_bare_machine_says_whose_key_it_will_keep_to(
    bare: BoxRoot, make_release: MakeRelease, maker: Path, stranger: Path
) -> None:
    said = taken(bare, make_release("1.0.0"))
    assert f"knows no key yet. This release is signed with the key {fingerprint(maker)}" in said
    assert "which this box does not know" in refused(bare, make_release("1.1.0", key=stranger))
    assert "knows no key" not in taken(bare, make_release("1.1.0"))


def test_a_bare_machine_that_was_told_the_key_takes_no_other(
    bare: BoxRoot, make_release: MakeRelease, maker: Path, stranger: Path
) -> None:
    ours = "--key", fingerprint(maker)
    said = refused(bare, *ours, make_release("1.0.0", key=stranger))
    assert f"signed with the key {fingerprint(stranger)}, not with {fingerprint(maker)}" in said
    taken(bare, *ours, make_release("1.0.0"))
    assert "--key needs the key's fingerprint" in refused(bare, "--key", "SHA256:short")


def test_a_release_brings_the_key_of_those_after_it(
    box: BoxRoot, make_release: MakeRelease, maker: Path, tmp_path: Path
) -> None:
    new = make_key(tmp_path / "keys", "new")
    between = make_release("1.1.0")
    sign(between, maker, new)
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


def test_keys_that_were_laid_beside_a_signed_release_count_for_nothing(
    box: BoxRoot, make_release: MakeRelease, stranger: Path
) -> None:
    release = make_release("1.1.0")
    with (release / "keys").open("a") as keys:
        keys.write((make_release("1.2.0", key=stranger) / "keys").read_text())
    assert "files of the release are damaged" in refused(box, release)


def test_a_box_whose_root_forgets_keeps_to_its_key(
    with_first_release: BoxRoot, make_release: MakeRelease, maker: Path, stranger: Path, tmp_path: Path
) -> None:
    box = ImageBox(tmp_path / "box", with_first_release)
    try:
        box.make()
        assert "which this box does not know" in refused(box, make_release("1.1.0", key=stranger))
        release = make_release("2.0.0")
        sign(release, stranger)
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
    words = ["--unsigned"] if unsigned else []
    taken(box, make_release("1.10.0"))
    older = make_release("1.9.0")
    said = refused(box, *words, older)
    assert "bunraku 1.9.0" in said and "older than 1.10.0, which dances. Nothing was changed" in said
    taken(box, *words, "--older", older)
    assert box.current == "1.9.0"


def test_a_key_that_lies_in_the_release_is_not_signed_with(make_release: MakeRelease) -> None:
    release = make_release("1.1.0")
    key = make_key(release)
    done = subprocess.run([SIGN, "--key", key, release], capture_output=True, text=True)
    assert done.returncode == 1 and "lies in the release" in done.stderr
