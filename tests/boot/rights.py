"""What a machine must have and allow so that a box can boot on it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from tests.system import namespace

_COMMANDS = {
    "systemd-nspawn": "systemd-container",
    "mmdebstrap": "mmdebstrap",
    "mke2fs": "e2fsprogs",
    "ssh-keygen": "openssh-client",
    "unshare": "util-linux",
    "nsenter": "util-linux",
}


def why_not() -> str | None:
    """Why no box can boot here; None when one can."""
    if os.geteuid() != 0:
        return "booting a box in a container needs root (run the tests as root)"
    for command, package in _COMMANDS.items():
        if shutil.which(command) is None:
            return f"the command {command} (Debian package {package}) is missing"
    known = Path("/proc/filesystems").read_text().split()
    for kind in ("overlay", "ext4", "cgroup2"):
        if kind not in known and subprocess.run(["modprobe", kind], capture_output=True).returncode != 0:
            return f"the kernel has no {kind}"
    if not Path("/dev/loop-control").exists():
        return "there are no loop devices (/dev/loop-control)"
    tried = subprocess.run(
        ["unshare", "--mount", "--propagation", "private", "mount", "-t", "tmpfs", "tmpfs", "/mnt"],
        capture_output=True,
        text=True,
    )
    if tried.returncode != 0:
        return f"mounting is not allowed here ({tried.stderr.strip()})"
    return namespace.why_not()


def no_memory_limits() -> str | None:
    """Why a box's memory cannot be limited; None when it can."""
    if Path("/sys/fs/cgroup/memory").is_dir():
        return None
    controllers = Path("/sys/fs/cgroup/cgroup.controllers")
    if controllers.exists() and "memory" in controllers.read_text().split():
        return None
    return "the control groups of this machine have no memory controller"
