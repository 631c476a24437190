"""The real Open Lighting Architecture daemon as a receiver of lights: configured, started, read back."""

from __future__ import annotations

import contextlib
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.parse
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Self

from hw_sim.peers import free_ports
from tests.system.namespace import Namespace
from tests.system.processes import wait_until

# Plugins that no test needs are switched off: each would open ports or devices.
PLUGINS = (
    *("artnet", "dummy", "e131", "espnet", "ftdidmx", "gpio", "karate", "kinet", "milinst", "opendmx"),
    *("openpixelcontrol", "osc", "pathport", "renard", "sandnet", "shownet", "spi", "stageprofi", "uartdmx"),
    *("usbdmx", "usbserial"),
)
USER = "nobody"  # olad refuses to run as root

Settings = Mapping[str, str | int | Sequence[str]]


def why_not() -> str | None:
    """Why it cannot run here; None if it can."""
    return None if shutil.which("olad") else "olad (Debian package ola) is missing"


class Olad:
    """One daemon with its own configuration, in a network if one is given.

    plugins: those switched on, with their settings. patched: universe of each port; a port is named
    plugin-device-direction-number, like 2-1-I-0 for the first Art-Net input.
    """

    def __init__(
        self, plugins: Mapping[str, Settings], patched: Mapping[str, int], network: Namespace | None = None
    ) -> None:
        self._plugins = plugins
        self._patched = patched
        self._network = network
        self._folder = Path(tempfile.mkdtemp(prefix="olad-"))
        self._process: subprocess.Popen[bytes] | None = None
        self.port = 0

    def start(self) -> None:
        """Start it and wait until it answers."""
        if not any(self._folder.iterdir()):
            self._configure()
        with self._inside():
            self.port, rpc = free_ports(2, socket.SOCK_STREAM)
        arguments = ["olad", "-c", str(self._folder), "-p", str(self.port), "-r", str(rpc), "-l", "3"]
        arguments += ["--no-register-with-dns-sd", *(("-i", "lo") if self._network else ())]
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                self._network.command(*self._as_user(arguments))
                if self._network
                else self._as_user(arguments),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        process = self._process

        def answers() -> bool:
            with contextlib.suppress(OSError):
                return bool(self.ask("json/server_stats"))
            assert process.poll() is None, f"olad ended:\n{self.log}"
            return False

        wait_until(answers, lambda: f"olad does not answer:\n{self.log}")

    def stop(self) -> None:
        """End it; its configuration stays for the next start."""
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.wait(10)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._process = None

    def __enter__(self) -> Self:
        try:
            self.start()
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    @property
    def log(self) -> str:
        """Its output so far."""
        return self._log.read_text(errors="replace") if self._log.exists() else ""

    def levels(self, universe: int) -> bytes:
        """The 512 levels that it has now."""
        answer = self.ask(f"get_dmx?u={universe}")
        digits = answer.partition("[")[2].partition("]")[0]
        return bytes(int(level) for level in digits.split(",") if level.strip()).ljust(512, b"\0")

    def await_levels(self, universe: int, levels: bytes) -> float:
        """Wait until it has exactly these levels; the time of that, monotonic seconds."""

        def missing() -> str:
            return f"it has {self.levels(universe)[:8].hex()}..., not {levels[:8].hex()}...\n{self.log}"

        wait_until(lambda: self.levels(universe) == levels, missing)
        return time.monotonic()

    def set_levels(self, universe: int, levels: bytes) -> None:
        """Set levels as from its own console."""
        shown = ",".join(str(level) for level in levels)
        self.ask("set_dmx", urllib.parse.urlencode({"u": universe, "d": shown}).encode())

    def ask(self, path: str, form: bytes | None = None) -> str:
        """Read one page of its web server. Raises OSError."""
        with (
            self._inside(),
            urllib.request.urlopen(f"http://127.0.0.1:{self.port}/{path}", form, timeout=5) as answer,
        ):
            return str(answer.read().decode())

    @property
    def _log(self) -> Path:
        return self._folder / "olad.log"

    def _end(self) -> None:
        self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _inside(self) -> contextlib.AbstractContextManager[None]:
        return self._network.entered() if self._network else contextlib.nullcontext()

    def _configure(self) -> None:
        for plugin in PLUGINS:
            settings: Settings = self._plugins.get(plugin, {})
            lines = [f"enabled = {'true' if plugin in self._plugins else 'false'}"]
            for key, value in settings.items():
                values = [value] if isinstance(value, str | int) else value
                lines += [f"{key} = {one}" for one in values]
            (self._folder / f"ola-{plugin}.conf").write_text("\n".join(lines) + "\n")
        ports = "".join(f"{port} = {universe}\n" for port, universe in self._patched.items())
        (self._folder / "ola-port.conf").write_text(ports)
        if os.geteuid() == 0:
            owner = pwd.getpwnam(USER)
            for path in (self._folder, *self._folder.iterdir()):
                os.chown(path, owner.pw_uid, owner.pw_gid)

    @staticmethod
    def _as_user(arguments: list[str]) -> list[str]:
        if os.geteuid() != 0:
            return arguments
        owner = pwd.getpwnam(USER)
        return ["setpriv", f"--reuid={owner.pw_uid}", f"--regid={owner.pw_gid}", "--clear-groups", *arguments]


def art_net_node(**settings: str | int) -> dict[str, Settings]:
    """Plugin settings of a node on loopback."""
    return {"artnet": {"ip": "127.0.0.1", "use_loopback": "true", "net": 0, "subnet": 0, **settings}}


def sacn_node(address: str) -> dict[str, Settings]:
    """Plugin settings of a node with this address."""
    return {"e131": {"ip": address, "input_ports": 2, "output_ports": 1, "ignore_preview": "true"}}


@contextlib.contextmanager
def shared_folder() -> Iterator[Path]:
    """A folder that the daemon's user can read, unlike a test's own."""
    with tempfile.TemporaryDirectory(prefix="widgets-") as name:
        Path(name).chmod(0o755)
        yield Path(name)
