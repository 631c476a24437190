"""A USB stick with the label BUNRAKU: its image, what lies on it, and how it is pulled while it is read."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from appliance.show.bundle import default_show_path, write_checksums


@dataclass(frozen=True)
class Stick:
    """An image of a file system; of ext4, for not every kernel that tests run on knows FAT."""

    image: Path

    @staticmethod
    def made(image: Path, content: Path, megabytes: int = 64) -> Stick:
        """With what lies in the folder `content`."""
        with image.open("wb") as made:
            made.truncate(megabytes << 20)
        _run("mke2fs", "-q", "-t", "ext4", "-L", "BUNRAKU", "-d", str(content), str(image))
        return Stick(image)

    def pull(self) -> None:
        """Whoever reads it from now on gets an error instead."""
        os.truncate(self.image, 0)
        devices = _run("losetup", "--associated", str(self.image), "--noheadings", "--output", "NAME")
        for device in devices.split():
            _run("losetup", "--set-capacity", device)


def show_on(stick: Path, name: str) -> Path:
    """A sound show of this name in the folder of a stick's content; it can be changed before it is sealed."""
    folder = stick / "bunraku" / "show"
    shutil.copytree(default_show_path(), folder)
    show = folder / "show.yaml"
    show.write_text(show.read_text().replace("name: One hand", f"name: {name}"))
    return sealed(folder)


def sealed(show: Path) -> Path:
    """The show with checksums of what lies in it now."""
    write_checksums(show)
    return show


def _run(*arguments: str) -> str:
    return subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
