"""A wrong clock for a box: the kernel has one for all containers, so its processes are told another time."""

from __future__ import annotations

import shutil
import struct
import subprocess
from pathlib import Path

INSIDE = "/wrong-clock"
ENVIRONMENT = {"LD_PRELOAD": f"{INSIDE}/library.so", "WRONG_CLOCK": f"{INSIDE}/off"}
DROP_IN = "/etc/systemd/system/bunraku-.service.d/90-clock.conf"
_YEAR_S = 365 * 86400


def why_not() -> str | None:
    """Why no clock can be made wrong here; None when one can."""
    return None if shutil.which("cc") else "a C compiler (Debian package gcc) is missing"


class WrongClock:
    """A folder to be bound into the box at INSIDE, and the units' drop-in."""

    def __init__(self, folder: Path, years: int) -> None:
        self.folder, self.drop_in = folder / "clock", folder / "clock.conf"
        self.folder.mkdir()
        command = ["cc", "-shared", "-fPIC", "-O2", "-Wall", "-Werror", "-o", str(self.folder / "library.so")]
        subprocess.run([*command, str(Path(__file__).with_suffix(".c"))], check=True)
        words = " ".join(f"{name}={value}" for name, value in ENVIRONMENT.items())
        self.drop_in.write_text(f"[Service]\nEnvironment={words}\n")
        self.binds = ((self.folder, INSIDE), (self.drop_in, DROP_IN))
        (self.folder / "off").touch()
        for path in (self.folder, *self.folder.iterdir(), self.drop_in):
            path.chmod(0o755)
        self.set(years)

    def set(self, years: int) -> None:
        """How far off it is from now on; all processes of the box see it at once."""
        with (self.folder / "off").open("r+b", buffering=0) as off:
            off.write(struct.pack("l", years * _YEAR_S))
