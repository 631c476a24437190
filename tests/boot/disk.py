"""The box's data disk: an ext4 image that a power cut damages as it damages a real one."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

BUNRAKU_ID = 990  # the box's user and group on every installation
_RELEASED_WITHIN_S = 60.0


@dataclass(frozen=True)
class DataDisk:
    """An image of the data partition."""

    image: Path

    @staticmethod
    def made(image: Path, files: dict[str, bytes], megabytes: int = 256) -> DataDisk:
        """Fresh, with these files in it (path below the partition's root); all belongs to the box's user."""
        content = image.with_suffix(".content")
        for name, data in {"bunraku/": b"", **files}.items():
            path = content / name
            (path if name.endswith("/") else path.parent).mkdir(parents=True, exist_ok=True)
            if not name.endswith("/"):
                path.write_bytes(data)
        for path in (content, *content.rglob("*")):
            path.chmod(0o700 if path.is_dir() else 0o600)
            os.chown(path, BUNRAKU_ID, BUNRAKU_ID)
        content.chmod(0o755)
        image.unlink(missing_ok=True)
        with image.open("wb") as made:
            made.truncate(megabytes << 20)
        _run("mke2fs", "-q", "-t", "ext4", "-L", "data", "-d", str(content), str(image))
        shutil.rmtree(content)
        return DataDisk(image)

    def copied(self, image: Path) -> DataDisk:
        """Another disk with the same content; zeros take no room."""
        _run("cp", "--sparse=always", str(self.image), str(image))
        return DataDisk(image)

    def grown(self, megabytes: int) -> None:
        """To this size, while it is in use nowhere."""
        self.repaired()
        with self.image.open("r+b") as image:
            image.truncate(megabytes << 20)
        _run("resize2fs", "-f", str(self.image))

    def changed(self, arguments: str) -> None:
        """By a line of shell in its root, while it is in use nowhere."""
        self.repaired()
        with tempfile.TemporaryDirectory() as root:
            mounted = f'mount -o loop "$1" "$2" && cd "$2" && {arguments} && cd / && umount "$2"'
            private = ("unshare", "--mount", "--propagation", "private")
            _run(*private, "sh", "-ec", mounted, "sh", str(self.image), root)
        self.await_release()

    def repaired(self) -> str:
        """Checked as before each boot; what was said. Raises AssertionError where that is not enough."""
        done = subprocess.run(["e2fsck", "-p", str(self.image)], capture_output=True, text=True)
        assert done.returncode in (0, 1), f"e2fsck -p: {done.returncode}\n{done.stdout}{done.stderr}"
        return done.stdout

    def sound(self) -> bool:
        """Whether a full check finds nothing at all."""
        return subprocess.run(["e2fsck", "-fn", str(self.image)], capture_output=True).returncode == 0

    def await_release(self) -> None:
        """Until nothing holds the image any more."""
        until = time.monotonic() + _RELEASED_WITHIN_S
        while _run("losetup", "--associated", str(self.image)):
            assert time.monotonic() < until, f"{self.image} is still in use."
            time.sleep(0.02)


def _run(*arguments: str) -> str:
    return subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
