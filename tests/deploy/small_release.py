"""A small package as `make deb` builds it: one tiny module, for roots that have no Debian 13."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from tests.conftest import ROOT

RELEASE = ROOT / "deploy" / "bunraku-release"
SCRIPTS = ROOT / "deploy" / "release" / "debian"
UNITS = "usr/lib/systemd/system"
CLOCK = "etc/chrony/conf.d/bunraku.conf"
CONTROL = """Package: bunraku
Version: {version}
Architecture: {arch}
Maintainer: a test
Description: a small bunraku
"""
FACTS = "version {version}\narchitecture {arch}\npython {python}\nbuild {build}\n"
TARGET = "[Unit]\nDescription=The box, version {version}\n"


def write_release(
    folder: Path,
    version: str,
    *,
    key: Path | None,
    python: str,
    arch: str = "",
    extra_unit: str = "",
    next_key: Path | None = None,
) -> Path:
    """The folder of a stick with a package whose command prints its version; key: None leaves it unsigned."""
    arch = arch or machine()
    top = folder / "top"
    if folder.exists():
        shutil.rmtree(folder)
    tree = top / "opt/bunraku/unpacked"
    files = {
        tree / f"lib/python{python}/site-packages/appliance/start.py": f"print('bunraku {version}')\n",
        tree / "bin/bunraku": f"#!/bin/sh\necho bunraku {version}\n",
        tree / "system" / UNITS / "bunraku.target": TARGET.format(version=version),
        top / CLOCK: f"# of {version}\n",
        top / "DEBIAN/control": CONTROL.format(version=version, arch=arch),
        top / "DEBIAN/conffiles": f"/{CLOCK}\n",
        tree / "release": FACTS.format(version=version, arch=arch, python=python, build=extra_unit or "one"),
    }
    if extra_unit:
        files[tree / "system" / UNITS / extra_unit] = "[Unit]\nDescription=Only in this release\n"
    if key is not None:
        files[tree / "keys"] = named(key, *([next_key] if next_key else []))
    for path, text in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tree / "bin/bunraku").chmod(0o755)
    (tree / "bin/python").symlink_to("/bin/true")
    shutil.copy(RELEASE, tree)
    links = {
        UNITS + "/" + path.name: f"system/{UNITS}/{path.name}" for path in (tree / "system" / UNITS).iterdir()
    }
    links |= {"usr/bin/bunraku": "bin/bunraku", "usr/sbin/bunraku-release": "bunraku-release"}
    for where, to in links.items():
        (top / where).parent.mkdir(parents=True, exist_ok=True)
        (top / where).symlink_to(f"/opt/bunraku/current/{to}")
    for script in ("postinst", "prerm", "postrm"):
        shutil.copy(SCRIPTS / script, top / "DEBIAN")
        (top / "DEBIAN" / script).chmod(0o755)
    package = folder / f"bunraku_{version}_{arch}.deb"
    build = ["dpkg-deb", "--root-owner-group", "-Znone", "--build", top, package]
    subprocess.run(build, check=True, stdout=subprocess.DEVNULL)
    shutil.rmtree(top)
    if key is not None:
        sign(package, key)
    return folder


def named(*keys: Path) -> str:
    """The file `keys` of a release: whose releases are taken after it."""
    public = (key.with_suffix(".pub").read_text().split() for key in keys)
    return "".join(f'release namespaces="bunraku-release" {kind} {text}\n' for kind, text, _ in public)


def package_of(stick: Path) -> Path:
    """The one package in a stick's folder."""
    return next(stick.glob("*.deb"))


def sign(package: Path, key: Path, purpose: str = "bunraku-release") -> None:
    """As the release's maker does it."""
    package.with_name(package.name + ".sig").unlink(missing_ok=True)
    command = ["ssh-keygen", "-q", "-Y", "sign", "-f", key, "-n", purpose, package]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)


def make_key(folder: Path, name: str = "maker") -> Path:
    """A key of a release's maker; the public half lies beside it, as NAME.pub."""
    folder.mkdir(parents=True, exist_ok=True)
    key = folder / name
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(key)], check=True)
    return key


def fingerprint(key: Path) -> str:
    """As people compare it."""
    return subprocess.check_output(["ssh-keygen", "-l", "-f", str(key)], text=True).split()[1]


def machine() -> str:
    """This machine's processor as Debian calls it."""
    return subprocess.check_output(["dpkg", "--print-architecture"], text=True).strip()
