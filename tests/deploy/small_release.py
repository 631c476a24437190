"""A small whole release as `make release` lays it out: one tiny wheel, for roots that have no Debian 13."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import zipfile
from pathlib import Path

from tests.conftest import ROOT

INSTALL = ROOT / "deploy" / "install.sh"
SIGN = ROOT / "deploy" / "release" / "sign"
TARGET = """[Unit]
Description=The box, version {version}

[Install]
WantedBy=multi-user.target
"""


def write_release(
    folder: Path, version: str, *, key: Path, python: str, extra_unit: str = "", broken: bool = False
) -> Path:
    """A release whose command prints its version; broken: one of its modules cannot be imported.

    key: with which it is signed.
    """
    if folder.exists():
        shutil.rmtree(folder)
    wheels = folder / "wheels"
    wheels.mkdir(parents=True)
    _write_wheel(wheels, version, "raise ImportError('a part is missing')" if broken else "")
    (folder / "unneeded.txt").write_text("# nothing\nappliance/unneeded\n")
    shutil.copy(INSTALL, folder / "install.sh")
    units = folder / "system/usr/lib/systemd/system"
    units.mkdir(parents=True)
    (units / "bunraku.target").write_text(TARGET.format(version=version))
    if extra_unit:
        (units / extra_unit).write_text("[Unit]\nDescription=Only in this release\n")
    clock = folder / "system/etc/chrony/conf.d"
    clock.mkdir(parents=True)
    (clock / "bunraku.conf").write_text(f"# of {version}\n")
    write_facts(folder, version=version, python=python)
    sign(folder, key)
    return folder


def write_facts(folder: Path, *, version: str, python: str, arch: str = "", needs_mb: int = 1) -> None:
    """What the release says of itself; it has to be signed anew."""
    lines = (
        f"version {version}",
        f"architecture {arch or machine()}",
        f"python {python}",
        f"needs-mb {needs_mb}",
    )
    (folder / "release").write_text("\n".join(lines) + "\n")


def make_key(folder: Path, name: str = "maker") -> Path:
    """A key of a release's maker; the public half lies beside it, as NAME.pub."""
    folder.mkdir(parents=True, exist_ok=True)
    key = folder / name
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(key)], check=True)
    return key


def fingerprint(key: Path) -> str:
    """As people compare it."""
    return subprocess.check_output(["ssh-keygen", "-l", "-f", str(key)], text=True).split()[1]


def sign(folder: Path, key: Path, *next_keys: Path) -> None:
    """As the release's maker does it: keys, sums of all files, signature."""
    wanted = [word for one in next_keys for word in ("--next-key", f"{one}.pub")]
    subprocess.run([SIGN, "--key", key, *wanted, folder], check=True, stdout=subprocess.DEVNULL)


def write_sums(folder: Path) -> None:
    """The sums of all files, unsigned, as anybody can write them."""
    files = sorted(one for one in folder.rglob("*") if one.is_file() and "SHA256SUMS" not in one.name)
    sums = "".join(f"{_digest(one)}  ./{one.relative_to(folder)}\n" for one in files)
    (folder / "SHA256SUMS").write_text(sums)


def machine() -> str:
    """This machine's processor as Debian calls it."""
    return subprocess.check_output(["dpkg", "--print-architecture"], text=True).strip()


def _write_wheel(folder: Path, version: str, part: str) -> None:
    files = {
        "appliance/__init__.py": "",
        "appliance/part.py": f"{part}\n",
        "appliance/start.py": f"def main() -> int:\n    print('bunraku {version}')\n    return 0\n",
        "appliance/unneeded/__init__.py": "",
    }
    with zipfile.ZipFile(folder / f"bunraku-{version}-py3-none-any.whl", "w") as wheel:
        for name, text in files.items():
            wheel.writestr(name, text)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
