"""One box that boots: power on, look inside, harm it, cut its power."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from tests.boot.disk import DataDisk
from tests.deploy.cut import cut_off
from tests.system.namespace import Namespace
from tests.system.processes import children, wait_until

NSPAWN = Path(__file__).parent / "nspawn.sh"
PATIENCE_S = 60.0  # for a machine that is busy with other things; nothing here waits without a reason
_PDEATHSIG = 1
_ENDS_WITHIN_S = 60.0
_ENVIRONMENT = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root"}
_numbers = itertools.count()

Found = TypeVar("Found")


@dataclass
class PowerOn:
    """With what a box is switched on. `memory`: bytes that all of it may use; `binds`: outside, inside."""

    disk: DataDisk | None = None
    disk_options: str = "commit=5,errors=remount-ro"
    stick: Path | None = None
    memory: int | None = None
    binds: Sequence[tuple[Path, str]] = ()


@dataclass
class Machine:
    """A box on a network of its own. `folder`: holds the root and what is said on the console.

    powered_at: when it was last switched on, seconds since 1970 of this machine's clock.
    """

    folder: Path
    network: Namespace
    process: subprocess.Popen[bytes] | None = None
    powered_at: float = 0.0
    pid1: int = 0
    started_with: PowerOn = field(default_factory=PowerOn)
    cgroup: str = ""

    def power_on(self, how: PowerOn) -> None:
        """From nothing to a PID 1; what it does then is its own affair."""
        assert self.process is None, "It is on already."
        self.started_with, self.cgroup = how, f"bunraku-boot-{os.getpid()}-{next(_numbers)}"
        command = ["unshare", "--mount", "--propagation", "private"]
        command += [str(NSPAWN), str(self.folder), self.cgroup]
        if how.disk is not None:
            command += ["--data", str(how.disk.image), how.disk_options]
        if how.stick is not None:
            command += ["--stick", str(how.stick)]
        if how.memory is not None:
            command += ["--memory", str(how.memory)]
        command += ["--", f"--network-namespace-path=/run/netns/{self.network.name}", "--hostname=bunraku"]
        command += [f"--bind-ro={outside}:{inside}" for outside, inside in how.binds]
        with (self.folder / "console.txt").open("ab") as console:
            self.powered_at = time.time()
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=console,
                stderr=subprocess.STDOUT,
                preexec_fn=_die_with_the_tests,
            )
        try:
            self.pid1 = self._await_pid1()
        except AssertionError:
            self.process.kill()
            self.process.wait()
            self.process = None
            _remove_groups(self.cgroup)
            raise

    def run(self, *arguments: str, check: bool = True, patience_s: float = PATIENCE_S) -> str:
        """What a command says that runs inside, as root, with nothing of this process's environment."""
        entered = ["nsenter", "--target", str(self.pid1), "--all", *arguments]
        done = subprocess.run(entered, capture_output=True, text=True, timeout=patience_s, env=_ENVIRONMENT)
        if check and done.returncode != 0:
            raise AssertionError(
                f"{' '.join(arguments)}: {done.returncode}\n{done.stdout}{done.stderr}\n{self.log()}"
            )
        return done.stdout

    def path(self, inside: str) -> Path:
        """A file of the box, seen from outside."""
        return Path(f"/proc/{self.pid1}/root{inside}")

    def show(self, unit: str, key: str) -> str:
        """A property of a unit."""
        return self.run("systemctl", "show", "--property", key, "--value", unit).strip()

    def main_pid(self, unit: str) -> int:
        """Of a unit's process, as this machine outside numbers it; 0 when it does not run.

        Read from the control group: the unit may be restarting, and systemctl would have to wait for it.
        """
        inside = self.show(unit, "MainPID")
        for line in self.run(
            "cat", f"/sys/fs/cgroup/system.slice/{unit}.service/cgroup.procs", check=False
        ).split():
            if line == inside:
                return _outside(self.pid1, int(line))
        return 0

    def kill(self, unit: str, number: int = signal.SIGKILL) -> float:
        """Send a signal to a unit's main process; when, seconds since 1970."""
        pid = self.await_that(lambda: self.main_pid(unit), f"{unit} does not run")
        now = time.time()
        os.kill(pid, number)
        return now

    def log(self, *units: str) -> str:
        """What the units (none: everything) said since power-on."""
        chosen = [word for unit in units for word in ("--unit", f"{unit}.service")]
        if self.process is None or self.process.poll() is not None:
            return (self.folder / "console.txt").read_text(errors="replace")
        return self.run("journalctl", "--no-pager", "--output=short-monotonic", *chosen, check=False)

    def await_that(
        self, find: Callable[[], Found | None], else_say: str, patience_s: float = PATIENCE_S
    ) -> Found:
        """The first true thing that `find` gives."""
        return wait_until(find, lambda: f"{else_say}\n{self.log()}", patience_s=patience_s)

    def cut_power(self) -> None:
        """Everything is gone between two instructions; what the data disk had not written stays unwritten."""
        assert self.process is not None
        if self.started_with.disk is not None:
            cut_off(self.mounted("data"))
        os.kill(self.pid1, signal.SIGKILL)
        self._gone()

    def power_off(self) -> None:
        """Switched off as one should: `systemctl poweroff`."""
        assert self.process is not None
        self.run("systemctl", "poweroff", check=False)
        self._gone()

    def mounted(self, what: str) -> Path:
        """The folder `data` or `stick`, as mounted for the box, seen from outside."""
        assert self.process is not None
        return Path(f"/proc/{self.process.pid}/root{self.folder}/box/{what}")

    def _await_pid1(self) -> int:
        """The box's PID 1 as numbered outside."""
        assert self.process is not None
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            assert self.process.poll() is None, (self.folder / "console.txt").read_text(errors="replace")
            for child in children(self.process.pid):
                if _numbered(child)[1:] == [1]:
                    return child
            time.sleep(0.002)
        raise AssertionError("No PID 1 came.")

    def _gone(self) -> None:
        assert self.process is not None
        try:
            self.process.wait(_ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(
                f"The box did not end.\n{(self.folder / 'console.txt').read_text()}"
            ) from None
        finally:
            self.process = None
            _remove_groups(self.cgroup)
        if self.started_with.disk is not None:
            self.started_with.disk.await_release()


@contextlib.contextmanager
def switched_on(machine: Machine, how: PowerOn) -> Iterator[Machine]:
    """A box that is on inside, and off afterwards whatever happened."""
    machine.power_on(how)
    try:
        yield machine
    finally:
        if machine.process is not None:
            machine.cut_power()


def _die_with_the_tests() -> None:
    ctypes.CDLL(None).prctl(_PDEATHSIG, signal.SIGKILL)


def _numbered(pid: int) -> list[int]:
    """A process' numbers: outside first, then in each namespace further in."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("NSpid:"):
                return [int(number) for number in line.split()[1:]]
    return []


def _outside(pid1: int, inside: int) -> int:
    """The number outside of a process that has the number `inside` in the box of this PID 1; 0: gone."""
    waiting = [pid1]
    while waiting:
        pid = waiting.pop()
        if _numbered(pid)[1:] == [inside]:
            return pid
        waiting += children(pid)
    return 0


def _remove_groups(name: str) -> None:
    """Control groups outlive their processes: take them away, the innermost first."""
    folders = [Path("/sys/fs/cgroup"), Path("/sys/fs/cgroup/unified"), Path("/sys/fs/cgroup/memory")]
    for folder in folders:
        for group in sorted((folder / name).glob("**/"), reverse=True):
            with contextlib.suppress(OSError):
                group.rmdir()
