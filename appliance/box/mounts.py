"""Mounted file systems, and whether data written to a folder outlives power-off."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

MOUNTINFO = Path("/proc/self/mountinfo")
_IN_MEMORY = ("tmpfs", "ramfs", "rootfs")
_ON_ITS_HOST = re.compile(r"/var/lib/(docker|containers|containerd)/")  # layers of a container
_MEMORY_DISK = re.compile(r"/dev/(zram|ram)\d+")
_OCTAL = re.compile(r"\\([0-7]{3})")


class Mount(NamedTuple):
    """One file system: its mount point, its kind (ext4, overlay ...), its device, all its options."""

    point: PurePosixPath
    kind: str
    source: str
    options: tuple[str, ...]

    @property
    def is_read_only(self) -> bool:
        return "ro" in self.options

    @property
    def name(self) -> str:
        """The disk by name, for people: 'mmcblk0p3 (/data)'; for a file system without one its kind."""
        disk = PurePosixPath(self.source).name if self.source.startswith("/dev/") else self.kind
        return f"{disk} ({self.point})"

    def option(self, name: str) -> str:
        """The value of an option, "" where it is not given."""
        return next((one.partition("=")[2] for one in self.options if one.startswith(f"{name}=")), "")


def mounts(text: str) -> list[Mount]:
    """From /proc/PID/mountinfo, or from /proc/mounts, proc(5); lines that are neither are left out."""
    return list(filter(None, map(_mount, text.splitlines())))


def _mount(line: str) -> Mount | None:
    before, dash, after = line.partition(" - ")
    words, behind = before.split(), after.split()
    if dash and len(words) >= 6 and len(behind) >= 3:
        point, options, (kind, source, more) = words[4], words[5], behind[:3]
        options = f"{options},{more}"
    elif not dash and len(words) >= 4:
        source, point, kind, options = words[:4]
    else:
        return None
    return Mount(PurePosixPath(_plain(point)), kind, _plain(source), tuple(options.split(",")))


def mount_of(path: Path | PurePosixPath, mounted: Sequence[Mount]) -> Mount | None:
    """The file system of an absolute path, links resolved: the deepest, of several there the last one."""
    place, found = PurePosixPath(path), None
    for one in mounted:
        if place.is_relative_to(one.point) and (found is None or one.point.is_relative_to(found.point)):
            found = one
    return found


def in_memory(one: Mount, mounted: Sequence[Mount]) -> bool:
    """Whether what is written there is gone with the power.

    An overlay keeps it where its upper folder lies. Below an overlay over the root that folder is often not
    seen, because it was mounted before the root was: then it is taken for memory, as the read-only modes of
    Raspberry Pi OS and of the image have it.
    """
    if one.kind in _IN_MEMORY or _MEMORY_DISK.fullmatch(one.source):
        return True
    upper = one.option("upperdir")
    if one.kind != "overlay" or not upper or _ON_ITS_HOST.match(upper):
        return False
    others = [other for other in mounted if other != one]
    below, root = mount_of(PurePosixPath(upper), others), PurePosixPath("/")
    is_seen = below is not None and not one.point == below.point == root
    return not is_seen or (below is not None and in_memory(below, others))


def disk_of(folder: Path) -> str:
    """The disk of a folder by name, for people; "" where this system does not say. It never waits for it."""
    one = mount_of(folder.absolute(), mounts_here())
    return "" if one is None else one.name


def memory_of(folder: Path) -> str:
    """The file system by name where what is written to a folder is gone with the power; "" where it lasts."""
    mounted = mounts_here()
    one = mount_of(folder.absolute(), mounted)
    return one.name if one is not None and in_memory(one, mounted) else ""


def mounts_here() -> list[Mount]:
    """As this process sees them; none where this system does not say."""
    try:
        return mounts(MOUNTINFO.read_text(errors="replace"))
    except OSError:
        return []


def _plain(word: str) -> str:
    return _OCTAL.sub(lambda found: chr(int(found[1], 8)), word)
