"""Roots to install into: this machine's own below, what a test writes above, on a disk that can be cut."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.deploy.cut import cut_off

_SIZE_MB = 64
_ENDS_WITHIN_S = 5.0
_PATH = "/usr/sbin:/usr/bin:/sbin:/bin"
_DATABASE = "var/lib/dpkg"


def why_not() -> str | None:
    """Why nothing can be installed into a root here; None when it can."""
    if os.geteuid() != 0:
        return "installing into a root of its own needs root (run the tests as root)"
    for command, package in (
        ("mke2fs", "e2fsprogs"),
        ("unshare", "util-linux"),
        ("dpkg", "dpkg"),
        ("cc", "gcc"),
        ("ssh-keygen", "openssh-client"),
    ):
        if shutil.which(command) is None:
            return f"the command {command} (Debian package {package}) is missing"
    if python() is None:
        return "there is no /usr/bin/python3.x in this machine's root"
    for kind in ("overlay", "ext4"):
        if kind not in Path("/proc/filesystems").read_text().split():
            return f"the kernel has no {kind}"
    if not Path("/dev/loop-control").exists():
        return "there are no loop devices (/dev/loop-control)"
    tried = subprocess.run(["unshare", "--mount", "--net", "true"], capture_output=True, text=True)
    return None if tried.returncode == 0 else f"namespaces are not allowed here ({tried.stderr.strip()})"


def python() -> str | None:
    """The version of the Python that every root here has, as 3.11."""
    found = sorted(path.name.removeprefix("python") for path in Path("/usr/bin").glob("python3.?[0-9]"))
    return found[-1] if found else None


@dataclass(frozen=True)
class BoxRoot:
    """A root file system whose written half lies on a small ext4 disk in `folder`."""

    folder: Path
    lent: set[Path] = field(default_factory=set, compare=False)

    @property
    def path(self) -> Path:
        return self.folder / "root"

    @property
    def disk(self) -> Path:
        return self.folder / "disk.ext4"

    @property
    def written(self) -> Path:
        return self.folder / "written"

    @property
    def releases(self) -> Path:
        return self.path / "opt/bunraku/releases"

    @property
    def current(self) -> str | None:
        """The version that dances; None when there is none."""
        link = self.path / "opt/bunraku/current"
        return link.readlink().name if link.is_symlink() else None

    def make(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        with self.disk.open("wb") as disk:
            disk.truncate(_SIZE_MB << 20)
        run("mke2fs", "-q", "-t", "ext4", str(self.disk))
        self.switch_on()

    def switch_on(self) -> None:
        """Mount it, as a boot does: the disk's journal is played back first."""
        self.written.mkdir(exist_ok=True)
        self.path.mkdir(exist_ok=True)
        run("mount", "-o", "loop,noatime", str(self.disk), str(self.written))
        for name in ("upper", "work"):
            (self.written / name).mkdir(exist_ok=True)
        prepare(self.written / "upper")
        above = f"lowerdir=/,upperdir={self.written}/upper,workdir={self.written}/work"
        run("mount", "-t", "overlay", "-o", above, "overlay", str(self.path))

    def switch_off(self) -> None:
        self.flush()
        for mounted in (self.path, self.written):
            unmount(mounted)
        self.release_disk()

    def flush(self) -> None:
        """Unmounting writes nothing while another mount namespace has the disk too; see release_disk."""
        subprocess.run(["sync", "--file-system", str(self.written)], capture_output=True)

    def release_disk(self) -> None:
        """A container that booted meanwhile has copied the mounts: from now on it holds another disk."""
        if subprocess.check_output(["losetup", "--associated", str(self.disk)]):
            copy = self.disk.with_suffix(".copy")
            run("cp", "--sparse=always", str(self.disk), str(copy))
            copy.replace(self.disk)

    def copy_of(self, other: BoxRoot) -> BoxRoot:
        """The same disk as `other`'s, which must be off; it is on afterwards."""
        self.folder.mkdir(parents=True, exist_ok=True)
        run("cp", "--sparse=always", str(other.disk), str(self.disk))
        self.switch_on()
        return self

    def cut_power(self) -> None:
        """What no sync has brought to the disk is lost."""
        cut_off(self.written)
        self.switch_off()

    def check_disk(self) -> int:
        """e2fsck, as the boot runs it; 0 and 1 (repaired) are sound."""
        return subprocess.run(["e2fsck", "-p", str(self.disk)], capture_output=True).returncode

    def lend(self, path: Path) -> Path:
        """The same path inside: what a test shares with programs of the box is mounted with the call."""
        self.lent.add(path)
        return path

    def call(
        self, *arguments: str | Path, env: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """A command inside, as root, without a network."""
        disk = os.open(self.written, os.O_RDONLY)
        mounts = [f"mount --rbind /dev {self.path}/dev", f"mount -t proc proc {self.path}/proc"]
        for path in self.lent | {
            Path(word) for word in arguments if Path(word).is_absolute() and Path(word).exists()
        }:
            inside = Path(f"{self.path}{path}")
            if path.is_dir():
                mounts.append(f"mkdir -p {inside} && mount --bind {path} {inside}")
            elif path.parent != Path("/usr/sbin"):
                mounts.append(f"mkdir -p {inside.parent} && touch {inside} && mount --bind {path} {inside}")
        entered = f'{" && ".join(mounts)} && exec chroot {self.path} env -i "$@"'
        settings = {"PATH": _PATH, "CUT_FD": str(disk), **(env or {})}
        inside = [*(f"{name}={value}" for name, value in settings.items()), *map(str, arguments)]
        command = ["unshare", "--mount", "--net", "sh", "-c", entered, "sh", *inside]
        try:
            return subprocess.run(command, capture_output=True, text=True, pass_fds=(disk,))
        finally:
            os.close(disk)

    def release(
        self, *arguments: str | Path, env: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """bunraku-release."""
        return self.call("/usr/sbin/bunraku-release", *arguments, env=env)

    def dpkg(
        self, *arguments: str | Path, env: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """dpkg, with a database of the box's own."""
        return self.call("dpkg", *arguments, env=env)

    def run(self, *arguments: str) -> str:
        """What a command in this root prints."""
        return subprocess.check_output(
            ["chroot", str(self.path), *arguments], text=True, stderr=subprocess.STDOUT
        )


def prepare(upper: Path) -> None:
    """A database of dpkg's own above this machine's: a directory that hides the one below."""
    database = upper / _DATABASE
    if not database.exists():
        for name in ("info", "updates", "triggers"):
            (database / name).mkdir(parents=True)
        (database / "status").touch()
        os.setxattr(database, "trusted.overlay.opaque", b"y")


def refused(box: BoxRoot, *arguments: str | Path) -> str:
    """What is said; the box has what it had."""
    before = box.current, files_of(box)
    done = box.release("install", *arguments)
    assert done.returncode == 1, done.stdout
    assert (box.current, files_of(box)) == before
    return done.stderr


def files_of(box: BoxRoot) -> list[str]:
    folder = box.path / "opt/bunraku"
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path != folder / "releases")


def taken(box: BoxRoot, *arguments: str | Path, env: dict[str, str] | None = None) -> str:
    done = box.release("install", *arguments, env=env)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def run(*arguments: str) -> str:
    """What a command prints that has to do what it should."""
    done = subprocess.run(arguments, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(arguments)}: {done.stderr}")
    return done.stdout


def unmount(folder: Path) -> None:
    """Also where nothing is mounted; what a script that was killed has started may need a moment to end."""
    until = time.monotonic() + _ENDS_WITHIN_S
    while folder.is_mount() and time.monotonic() < until:
        subprocess.run(["umount", str(folder)], capture_output=True)
        time.sleep(0.01)
    if folder.is_mount():
        run("umount", "--lazy", str(folder))
