"""Releases that are wrong in a chosen way, made from a sound one as it lies on a stick."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

from tests.boot.root import MAKER
from tests.deploy.small_release import sign


def changed_release(sound: Path, folder: Path, version: str, module: str, last_lines: str) -> Path:
    """The same release as another version, with `last_lines` at the end of one of bunraku's modules.

    All its hashes are right, and its maker has signed it: what is wrong shows only when it runs.
    """
    shutil.copytree(sound, folder)
    wheel = next((folder / "wheels").glob("bunraku-*.whl"))
    _rewrite(wheel, module, last_lines)
    facts = [
        line for line in (folder / "release").read_text().splitlines() if not line.startswith("version ")
    ]
    (folder / "release").write_text("\n".join([f"version {version}", *facts]) + "\n")
    sign(folder, MAKER)
    return folder


def _rewrite(wheel: Path, module: str, last_lines: str) -> None:
    part = wheel.with_suffix(".part")
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(part, "w") as new:
        assert module in old.namelist()
        for info in old.infolist():
            data = old.read(info)
            changed = data + last_lines.encode() if info.filename == module else data
            new.writestr(info, changed, zipfile.ZIP_STORED)
    part.replace(wheel)
