"""The package of this working tree, as `make deb` makes it, once for all tests that need it."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.conftest import ROOT
from tests.deploy.small_release import make_key

BUILT = ROOT / "build" / "boot"
MAKER = BUILT / "maker"  # the key of the release's maker, made here, thrown away with `build`
INPUTS = ("appliance", "hw_sim", "deploy", "distributions", "pyproject.toml")
_MAKE_DEB = ROOT / "deploy" / "release" / "make-deb"
_UNSTABLE = {"__pycache__"}


def made_package() -> Path:
    """Signed by MAKER. Raises RuntimeError with what make-deb said."""
    BUILT.mkdir(parents=True, exist_ok=True)
    with (BUILT / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        folder = BUILT / f"package-{key_of(*INPUTS)}"
        if not folder.exists():
            for old in BUILT.glob("package-*"):
                shutil.rmtree(old)
            if not MAKER.exists():
                make_key(MAKER.parent, MAKER.name)
            part = BUILT / "package.part"
            shutil.rmtree(part, ignore_errors=True)
            call(_MAKE_DEB, "--quick", "--out", part, "--key", MAKER)
            part.rename(folder)
        return next(folder.glob("*.deb"))


def key_of(*names: str) -> str:
    """Another one when a file in these folders of the working tree is another one."""
    digest = hashlib.sha256()
    found = (path for name in names for path in (ROOT / name, *(ROOT / name).rglob("*")) if path.is_file())
    for path in sorted(one for one in found if not _UNSTABLE & set(one.parts)):
        digest.update(f"{path.relative_to(ROOT)}\0{os.access(path, os.X_OK)}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def call(*arguments: str | Path) -> None:
    """A program that builds. Raises RuntimeError with what it said."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        arguments, stdin=subprocess.DEVNULL, capture_output=True, text=True, env=environment
    )
    if done.returncode != 0:
        raise RuntimeError(f"{arguments[0]}: {done.returncode}\n{done.stdout}{done.stderr}")
