"""The root that boots: built as the image's is, from the working tree, and kept until an input changes."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from tests.conftest import ROOT
from tests.deploy.made_package import BUILT, INPUTS, call, key_of, made_package

MKROOT = ROOT / "deploy" / "image" / "mkroot.sh"
_DEBIAN = tuple(f"deploy/image/{name}" for name in ("mkroot.sh", "packages-box.txt", "drop-files.txt"))


def root_image() -> Path:
    """The folder of this working tree's root; half a minute when Debian's part is there, else a minute."""
    folder = BUILT / f"root-{key_of(*INPUTS)}"
    image = folder / "root"
    if not image.exists():
        for old in BUILT.glob("root-*"):
            shutil.rmtree(old)
        folder.mkdir(parents=True)
        _build(image)
    return image


def _build(image: Path) -> None:
    debian, part = BUILT / f"debian-{key_of(*_DEBIAN)}.tar", image.with_suffix(".part")
    for old in BUILT.glob("debian-*.tar"):
        if old != debian:
            old.unlink()
    kept = [] if "CI" in os.environ else ["--debian", str(debian)]  # there this root is the only one
    call(MKROOT, "--without-kernel", "--deb", made_package(), *kept, part)
    part.rename(image)
