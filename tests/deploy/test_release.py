"""What a release is made of: locks with hashes and without hosts, the same packages for every processor."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.deploy.made_package import MAKER, made_package
from tests.deploy.small_release import make_key

RELEASE = ROOT / "deploy" / "release"
LINE = re.compile(r"(?P<name>[A-Za-z0-9_.]+)==(?P<version>[0-9][0-9A-Za-z.]*) --hash=sha256:[0-9a-f]{64}")
TREE = "opt/bunraku/unpacked"


def _pins(lock: str) -> dict[str, str]:
    """Name (as package indexes spell it) to version."""
    pins: dict[str, str] = {}
    for line in (RELEASE / lock).read_text().splitlines():
        if not line.startswith("#"):
            found = LINE.fullmatch(line)
            assert found is not None, f"{lock}: {line}"
            pins[found["name"].lower().replace("_", "-")] = found["version"]
    return pins


AMD64, ARM64 = "requirements-amd64.lock", "requirements-arm64.lock"
FROM_DEBIAN = {"moderngl", "glcontext"}  # on arm64


@pytest.mark.parametrize(("lock", "others"), [(AMD64, set()), (ARM64, FROM_DEBIAN)])
def test_everything_that_the_box_needs_is_pinned(lock: str, others: set[str]) -> None:
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    names = {re.split(r"[<>=~! ]", one)[0].lower().replace("_", "-") for one in needed}
    assert names - set(_pins(lock)) - others == set(), "run deploy/release/lock"


def test_a_box_has_the_same_packages_on_every_processor() -> None:
    amd64 = _pins(AMD64)
    assert {name: version for name, version in amd64.items() if name not in FROM_DEBIAN} == _pins(ARM64)


def test_no_lock_and_no_script_names_a_host() -> None:
    for path in (path for path in RELEASE.rglob("*") if path.is_file()):
        assert "://" not in path.read_text(), path.name


def test_what_is_left_out_of_an_installation_is_never_loaded() -> None:
    """The patterns as modules: nothing that the whole box imports comes from there."""
    modules = {
        line.removesuffix(".py").replace("/", ".")
        for line in (RELEASE / "unneeded.txt").read_text().splitlines()
        if line and "*" not in line and not line.startswith("#")
    }
    code = (
        "import importlib, pkgutil, sys, appliance, hw_sim\n"
        "for package in (appliance, hw_sim):\n"
        "    for one in pkgutil.walk_packages(package.__path__, package.__name__ + '.'):\n"
        "        if not one.name.startswith('appliance.studio') and not one.name.endswith('__main__'):\n"
        "            importlib.import_module(one.name)\n"
        "print(*sys.modules)"
    )
    loaded = subprocess.check_output([sys.executable, "-c", code], text=True, cwd=ROOT).split()
    assert [
        name for name in loaded if any(name == one or name.startswith(f"{one}.") for one in modules)
    ] == []


@pytest.mark.parametrize(
    "script", ["bunraku-release", "release/make-deb", "release/lock", "release/pack-downloads"]
)
def test_every_script_teaches_its_use(script: str) -> None:
    done = subprocess.run([ROOT / "deploy" / script, "--help"], capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stdout.startswith("Usage: ")


@pytest.fixture(scope="module")
def made() -> Path:
    """A package of this working tree; what is in it comes from build/release, or from the network once."""
    try:
        return made_package()
    except RuntimeError as error:
        if "Is there a network" in str(error):
            pytest.skip(f"No package can be made here: {error}")
        raise


@pytest.fixture(scope="module")
def unpacked(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What it lays onto a root."""
    root = tmp_path_factory.mktemp("unpacked")
    subprocess.run(["dpkg-deb", "--extract", made, root], check=True)
    return root


def test_a_package_is_signed_with_the_key_that_it_names(made: Path, unpacked: Path) -> None:
    keys = unpacked / TREE / "keys"
    with made.open("rb") as package:
        subprocess.run(
            [
                *("ssh-keygen", "-Y", "verify", "-f", keys, "-I", "release"),
                *("-n", "bunraku-release", "-s", f"{made}.sig"),
            ],
            stdin=package,
            check=True,
        )
    assert keys.read_text().split()[2:] == MAKER.with_suffix(".pub").read_text().split()[:2]
    private = MAKER.read_bytes().splitlines()[2]
    assert not [path for path in unpacked.rglob("*") if path.is_file() and private in path.read_bytes()]


def test_a_package_brings_exactly_what_is_pinned_and_the_box_itself(unpacked: Path) -> None:
    found = [path.name.split("-")[:2] for path in _packages(unpacked).glob("*.dist-info")]
    brought = {name.lower().replace("_", "-"): version.removesuffix(".dist") for name, version in found}
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert brought == _pins(AMD64) | {"bunraku": version, "bunraku-sim": version}
    facts = (unpacked / TREE / "release").read_text()
    assert facts.startswith(f"version {version}\narchitecture amd64\npython 3.13\n")


def test_a_package_has_everything_of_the_box_that_is_no_python(unpacked: Path) -> None:
    packages = _packages(unpacked)
    kinds = {".yaml", ".onnx", ".bvh", ".glsl", ".json", ".png", ".npz"}
    there = {path.relative_to(ROOT) for path in (ROOT / "appliance").rglob("*") if path.suffix in kinds}
    assert {file for file in there if "studio" not in file.parts and not (packages / file).exists()} == set()
    assert not (packages / "appliance/studio").exists()


def test_every_module_has_bytecode_and_every_link_of_the_package_leads_to_a_file_of_it(
    unpacked: Path,
) -> None:
    compiled = "__pycache__/{}.cpython-313.pyc"
    modules = list(_packages(unpacked).rglob("*.py"))
    assert [one for one in modules if not (one.parent / compiled.format(one.stem)).exists()] == []
    links = [path for path in (unpacked / "usr").rglob("*") if path.is_symlink()]
    assert len(links) > 30
    for link in links:
        inside = str(link.readlink()).replace("/opt/bunraku/current", f"{unpacked}/{TREE}")
        assert os.path.lexists(link.parent / inside), link


def _packages(unpacked: Path) -> Path:
    return unpacked / TREE / "lib/python3.13/site-packages"


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
