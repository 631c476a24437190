"""A box made from the image: its root forgets, its data partition does not, and its power can be cut."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from tests.deploy.box_root import BoxRoot, run, unmount


@dataclass(frozen=True)
class ImageBox(BoxRoot):
    """`image`: a box that is off, whose disk is this one's root; it is only read."""

    image: BoxRoot = field(kw_only=True)

    @property
    def written(self) -> Path:
        """The data partition, all that outlives the power."""
        return self.path / "data"

    @property
    def releases(self) -> Path:
        return self.written / "bunraku-releases"

    @property
    def next_choice(self) -> str | None:
        """What the data partition says is to dance at the next power-on; None: what came with the image."""
        link = self.releases / "current"
        return link.readlink().name if link.is_symlink() else None

    def switch_on(self) -> None:
        """Everything is as the image has it, then the data partition comes, then what its unit calls."""
        below, memory = self.folder / "below", self.folder / "memory"
        for folder in (below, memory, self.path):
            folder.mkdir(exist_ok=True)
        # A device of its own: other boxes have the same disk.
        device = run("losetup", "--find", "--show", "--read-only", str(self.image.disk)).strip()
        run("mount", "-o", "ro,noload", device, str(below))
        run("losetup", "--detach", device)
        run("mount", "-t", "tmpfs", "memory", str(memory))
        for name in ("upper", "work"):
            (memory / name).mkdir()
        above = f"lowerdir={below}/upper:/,upperdir={memory}/upper,workdir={memory}/work"
        run("mount", "-t", "overlay", "-o", above, "overlay", str(self.path))
        self.written.mkdir(exist_ok=True)
        run("mount", "-o", "loop,noatime,nosuid,nodev", str(self.disk), str(self.written))
        if (self.releases / "current").is_symlink():
            done = self.release("at-power-on")
            assert done.returncode == 0, done.stderr

    def switch_off(self) -> None:
        self.flush()
        for mounted in (self.written, self.path, self.folder / "memory", self.folder / "below"):
            unmount(mounted)
        self.release_disk()

    def remount_data(self, options: str) -> None:
        run("mount", "-o", f"remount,{options}", str(self.written))
