"""Releases that are wrong in a chosen way, made from a sound one as it lies on a stick."""

from __future__ import annotations

import hashlib
import shutil
import zipfile
from pathlib import Path


def changed_release(sound: Path, folder: Path, version: str, module: str, last_lines: str) -> Path:
    """The same release as another version, with `last_lines` at the end of one of bunraku's modules.

    All its hashes are right: what is wrong shows only when it runs.
    """
    shutil.copytree(sound, folder)
    wheel = next((folder / "wheels").glob("bunraku-*.whl"))
    _rewrite(wheel, module, last_lines)
    facts = [
        line for line in (folder / "release").read_text().splitlines() if not line.startswith("version ")
    ]
    (folder / "release").write_text("\n".join([f"version {version}", *facts]) + "\n")
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "SHA256SUMS")
    sums = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  ./{path.relative_to(folder)}\n" for path in files
    ]
    (folder / "SHA256SUMS").write_text("".join(sums))
    return folder


def _rewrite(wheel: Path, module: str, last_lines: str) -> None:
    part = wheel.with_suffix(".part")
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as new:
        assert module in old.namelist()
        for info in old.infolist():
            data = old.read(info)
            new.writestr(info, data + last_lines.encode() if info.filename == module else data)
    part.replace(wheel)
