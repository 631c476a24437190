"""Packages that are wrong in a chosen way, made from a sound one as it lies on a stick."""

from __future__ import annotations

import subprocess
from pathlib import Path

from tests.deploy.made_package import MAKER
from tests.deploy.small_release import sign

TREE = "opt/bunraku/unpacked"


def changed_release(
    sound: Path, folder: Path, version: str, module: str, last_lines: str, unit: str = ""
) -> Path:
    """A stick's folder with the same release as another version; `last_lines` end one of bunraku's modules.

    Its maker has signed it: what is wrong shows only when it runs. unit: more lines of the console's unit.
    """
    folder.mkdir(parents=True)
    top = folder.with_name(folder.name + ".top")
    subprocess.run(["dpkg-deb", "--raw-extract", sound, top], check=True)
    tree = top / TREE
    [changed] = tree.glob(f"lib/python3*/site-packages/{module}")
    with changed.open("a") as end:
        end.write(last_lines)
    for compiled in (changed.parent / "__pycache__").glob(f"{changed.stem}.*.pyc"):
        compiled.unlink()
    with (tree / "system/usr/lib/systemd/system/bunraku-console.service").open("a") as end:
        end.write(unit)
    for facts, name in ((tree / "release", "version "), (top / "DEBIAN/control", "Version: ")):
        lines = facts.read_text().splitlines()
        facts.write_text(
            "".join(f"{name}{version}\n" if one.startswith(name) else f"{one}\n" for one in lines)
        )
    package = folder / sound.name.replace(sound.name.split("_")[1], version)
    subprocess.run(["dpkg-deb", "--root-owner-group", "-Zzstd", "-z1", "--build", top, package], check=True)
    subprocess.run(["rm", "-r", top], check=True)
    sign(package, MAKER)
    return folder
