"""What users download is packed into one folder with signed sums, and the signature verifies."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.deploy.small_release import make_key

PACK = ROOT / "deploy" / "release" / "pack-downloads"


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """The folder out/ after all builds, in small."""
    out = tmp_path / "out"
    for file in (
        out / "bunraku_0.2.0_amd64.deb",
        out / "bunraku_0.2.0_amd64.deb.sig",
        out / "bunraku-amd64.img",
        out / "bunraku-amd64.img.spdx.json",
        out / "dist" / "bunraku-0.2.0.tar.gz",
        out / "firmware" / "wearable.ino.bin",
        out / "firmware" / "wearable.ino.elf",
        out / "bunraku-notes" / "text",
    ):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(file.name)
    return out


def pack(built: Path, key: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [PACK, "--key", key, "--next-key", "other.pub", built], capture_output=True, text=True, check=False
    )


def test_all_downloads_are_in_the_signed_sums(built: Path, tmp_path: Path) -> None:
    (built / "downloads").mkdir()
    (built / "downloads" / "brought.whl").write_text("from another job")
    done = pack(built, make_key(tmp_path / "keys"))
    assert done.returncode == 0, done.stderr
    folder = built / "downloads"
    named = {line.split()[1] for line in (folder / "SHA256SUMS").read_text().splitlines()}
    assert named == {
        *("bunraku_0.2.0_amd64.deb", "bunraku_0.2.0_amd64.deb.sig", "bunraku-amd64.img.xz"),
        *("bunraku-amd64.img.spdx.json", "bunraku-0.2.0.tar.gz"),
        *("wearable.ino.bin", "brought.whl", "release-key"),
    }
    assert {path.name for path in folder.iterdir()} == named | {"SHA256SUMS", "SHA256SUMS.sig"}
    for command in (
        "ssh-keygen -Y verify -f release-key -I release -n bunraku-download -s SHA256SUMS.sig <SHA256SUMS",
        "sha256sum --check --strict SHA256SUMS",
    ):
        subprocess.run(["bash", "-c", command], cwd=folder, check=True, capture_output=True)
    assert not [path for path in folder.iterdir() if b"PRIVATE KEY" in path.read_bytes()]


def test_packing_again_gives_the_same_sums(built: Path, tmp_path: Path) -> None:
    key = make_key(tmp_path / "keys")
    assert pack(built, key).returncode == 0
    sums = (built / "downloads" / "SHA256SUMS").read_text()
    assert pack(built, key).returncode == 0
    assert (built / "downloads" / "SHA256SUMS").read_text() == sums


def test_an_unsigned_release_or_no_key_is_refused(built: Path, tmp_path: Path) -> None:
    assert "name the key with --key" in pack(built, tmp_path / "missing").stderr
    (built / "bunraku_0.2.0_amd64.deb.sig").unlink()
    refused = pack(built, make_key(tmp_path / "keys"))
    assert refused.returncode == 1 and "is not signed" in refused.stderr


def test_nothing_to_pack_is_said(tmp_path: Path) -> None:
    refused = pack(tmp_path / "empty", make_key(tmp_path / "keys"))
    assert refused.returncode == 1 and "nothing to pack" in refused.stderr
