"""The root that boots: built as the image's is, from the working tree, and kept until an input changes."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.conftest import ROOT
from tests.deploy.small_release import make_key

MKROOT = ROOT / "deploy" / "image" / "mkroot.sh"
MAKE_DEB = ROOT / "deploy" / "release" / "make-deb"
BUILT = ROOT / "build" / "boot"
MAKER = BUILT / "maker"  # the key of the release's maker, made here, thrown away with `build`
_INPUTS = ("appliance", "hw_sim", "deploy", "distributions", "pyproject.toml")
_DEBIAN = tuple(f"deploy/image/{name}" for name in ("mkroot.sh", "packages-box.txt", "drop-files.txt"))
_UNSTABLE = {"__pycache__"}


def root_image() -> Path:
    """The folder of this working tree's root; half a minute when Debian's part is there, else a minute."""
    folder = BUILT / f"root-{_key(_files(*_INPUTS))}"
    image = folder / "root"
    if not image.exists():
        for old in BUILT.glob("root-*"):
            shutil.rmtree(old)
        folder.mkdir(parents=True)
        _build(folder, image)
    return image


def release(root: Path) -> Path:
    """The package that is installed in this root, as `make deb` makes it; signed by MAKER."""
    return next(root.parent.glob("bunraku_*.deb"))


def _build(folder: Path, image: Path) -> None:
    debian, part = BUILT / f"debian-{_key(_files(*_DEBIAN))}.tar", image.with_suffix(".part")
    for old in BUILT.glob("debian-*.tar"):
        if old != debian:
            old.unlink()
    if not MAKER.exists():
        make_key(MAKER.parent, MAKER.name)
    _run(str(MAKE_DEB), "--quick", "--out", str(folder), "--key", str(MAKER))
    made = [str(MKROOT), "--without-kernel", "--deb", str(release(image))]
    kept = [] if "CI" in os.environ else ["--debian", str(debian)]  # there this root is the only one
    _run(*made, *kept, str(part))
    part.rename(image)


def _files(*names: str) -> list[Path]:
    found: list[Path] = []
    for name in names:
        path = ROOT / name
        found += [path] if path.is_file() else [one for one in path.rglob("*") if one.is_file()]
    return sorted(one for one in found if not _UNSTABLE & set(one.parts))


def _key(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for path in files:
        digest.update(f"{path.relative_to(ROOT)}\0{os.access(path, os.X_OK)}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def _run(*arguments: str) -> None:
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        arguments, stdin=subprocess.DEVNULL, capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, f"{' '.join(arguments)}: {done.returncode}\n{done.stdout}{done.stderr}"
