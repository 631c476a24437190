"""The root that boots: built as the image's is, from the working tree, and kept until an input changes."""

from __future__ import annotations

import fcntl
import os
import shutil
import time
from pathlib import Path

from tests.conftest import ROOT
from tests.deploy.made_package import BUILT, INPUTS, call, key_of, made_package

MKROOT = ROOT / "deploy" / "image" / "mkroot.sh"
_DEBIAN = tuple(f"deploy/image/{name}" for name in ("mkroot.sh", "packages-box.txt", "drop-files.txt"))
_FOR_ALL_CHECKOUTS = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "bunraku"
_FRESH_S = 30 * 86400.0  # Debian mends its packages


def root_image() -> Path:
    """The folder of this working tree's root; half a minute when Debian's part is there, else two."""
    folder = BUILT / f"root-{key_of(*INPUTS)}"
    image = folder / "root"
    if not image.exists():
        for old in BUILT.glob("root-*"):
            shutil.rmtree(old)
        folder.mkdir(parents=True)
        _build(image)
    return image


def _build(image: Path) -> None:
    """Debian's part is taken from any checkout of this user that had the same one this month."""
    part, debian = image.with_suffix(".part"), _FOR_ALL_CHECKOUTS / f"debian-{key_of(*_DEBIAN)}.tar"
    package = made_package()
    _FOR_ALL_CHECKOUTS.mkdir(parents=True, exist_ok=True)
    with (_FOR_ALL_CHECKOUTS / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for old in _FOR_ALL_CHECKOUTS.glob("debian-*.tar"):
            if old != debian or time.time() - old.stat().st_mtime > _FRESH_S:
                old.unlink()
        call(MKROOT, "--without-kernel", "--deb", package, "--debian", debian, part)
    part.rename(image)
