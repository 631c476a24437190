"""Real file systems for tests: small ones in memory, read-only ones, and disks whose power is cut."""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

_plugs = itertools.count()


def why_not() -> str | None:
    """Why this test run cannot mount anything; None when it can."""
    if os.geteuid() != 0:
        return "mounting a file system needs the rights of an administrator (run the tests as root)"
    tried = subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False)
    return None if tried.returncode == 0 else "this machine lets nobody mount a file system"


@contextlib.contextmanager
def mounted(folder: Path, *how: str) -> Iterator[Path]:
    """A file system at a folder, by `mount` with these arguments; skips where it cannot be had."""
    import pytest

    folder.mkdir(exist_ok=True)
    tried = subprocess.run(["mount", *how, str(folder)], capture_output=True, text=True, check=False)
    if tried.returncode != 0:
        pytest.skip(f"this machine does not mount it: {tried.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def tiny(folder: Path, size: str) -> contextlib.AbstractContextManager[Path]:
    """A file system in memory that holds so much."""
    return mounted(folder, "-t", "tmpfs", "-o", f"size={size}", "tmpfs")


def fill(disk: Path, but: int = 0) -> Path:
    """Take all the room that is left, but for this many bytes; the file that takes it."""
    ballast = disk / "ballast"
    with ballast.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            file.truncate(file.tell() - but)
            return ballast


def made_image(path: Path, megabytes: int = 8) -> Path:
    """A disk with an ext4 file system, as a file."""
    with path.open("wb") as stream:
        stream.truncate(megabytes * 2**20)
    subprocess.run(["mkfs.ext4", "-q", "-F", str(path)], check=True)
    return path


@contextlib.contextmanager
def disk(image: Path, folder: Path, how: str = "rw") -> Iterator[Path]:
    """The disk of an image, mounted rw or ro.

    Each time it is a file of its own: whoever makes a mount namespace meanwhile holds on to this mount, and
    the same file mounted again would be the file system that has lost its power.
    """
    plugged = image.with_name(f"{image.name}.{next(_plugs)}")
    shutil.copyfile(image, plugged)
    if how == "ro":  # nothing else would bring its own journal to an end
        subprocess.run(["e2fsck", "-p", str(plugged)], capture_output=True, check=False)
    try:
        with mounted(folder, "-o", f"loop,{how}", str(plugged)):
            yield folder
            subprocess.run(["sync", "--file-system", str(folder)], capture_output=True, check=False)
    finally:
        shutil.copyfile(plugged, image)
        plugged.unlink()


@contextlib.contextmanager
def frozen(folder: Path) -> Iterator[None]:
    """A file system that does not answer: writes wait in the kernel, where no signal ends them."""
    subprocess.run(["fsfreeze", "--freeze", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["fsfreeze", "--unfreeze", str(folder)], check=False)
