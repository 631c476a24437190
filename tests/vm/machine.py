"""A whole machine in software: the real image starts in qemu, with a user at its serial console."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import time
from pathlib import Path
from types import TracebackType

CONSOLE_PROMPT = "technician# "
"""Set after the login, so that the end of a command's output is known."""


class Machine:
    """One box of this image; its disk belongs to it alone and outlives its power."""

    def __init__(self, disk: Path, folder: Path) -> None:
        self.disk, self.folder, self.is_pi = disk, folder, _is_pi(disk)
        self.console = Console(folder / "console", folder / "console.log")
        self._qemu: subprocess.Popen[bytes] | None = None
        self._powered_on = 0.0

    def power_on(self) -> None:
        """Presses the button; returns at once."""
        assert self._qemu is None, "the machine runs already"
        self._powered_on = time.monotonic()
        self._qemu = subprocess.Popen(self._command(), stdin=subprocess.DEVNULL)
        self.console.plug_in(self._qemu)

    def cut_power(self) -> None:
        """Pulls the plug: whatever the machine had not written is gone."""
        assert self._qemu is not None, "the machine is off"
        self._qemu.kill()
        self._qemu.wait()
        self._qemu = None
        self.console.unplug()

    def seconds_on(self) -> float:
        return time.monotonic() - self._powered_on

    def ask_qemu(self, command: str) -> None:
        """One line to qemu itself, as `device_del dmx`."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as monitor:
            monitor.connect(str(self.folder / "monitor"))
            monitor.sendall(f"{command}\n".encode())
            monitor.settimeout(5)
            seen = b""
            while seen.count(b"(qemu)") < 2:
                seen += monitor.recv(4096)

    def __enter__(self) -> Machine:
        return self

    def __exit__(self, kind: type[BaseException] | None, what: object, trace: TracebackType | None) -> None:
        if self._qemu is not None:
            self.cut_power()

    def _command(self) -> list[str]:
        # -icount: the machine's own clock counts its instructions, 2 ns each: it is a slow but steady machine
        # however busy this one is; all times inside are its own, the clock of the day too.
        command = "-accel tcg -icount shift=1 -smp 2 -nodefaults -no-user-config -rtc clock=vm"
        command += " -display none -device i6300esb -action watchdog=reset -device qemu-xhci,id=usb"
        command += " -netdev user,id=net -device virtio-net-pci,netdev=net,romfile= -device virtio-rng-pci"
        command += " -uuid 6c1f3c8e-6a55-4a0e-9a63-0b5a6c0b8d11 -chardev null,id=adapter"
        arguments = ["qemu-system-aarch64" if self.is_pi else "qemu-system-x86_64", *command.split()]
        pc = ["-machine", "q35", "-cpu", "max", "-m", "2048", *_uefi()]
        arguments += self._loader() if self.is_pi else pc
        arguments += ["-drive", f"file={self.disk},format=raw,if=none,id=disk,discard=unmap"]
        arguments += ["-device", "virtio-blk-pci,drive=disk"]
        console = f"socket,id=tty,path={self.console.path},server=on,wait=off"
        arguments += ["-chardev", console, "-serial", "chardev:tty"]
        arguments += ["-monitor", f"unix:{self.folder / 'monitor'},server=on,wait=off"]
        return arguments

    def _loader(self) -> list[str]:
        """What a Pi's loader does: kernel, start image and command line from the boot partition.

        The processor is a Pi 4's, the machine around it is no Pi.
        """
        for name in ("linux", "initrd", "cmdline.txt"):
            subprocess.run(
                ["mcopy", "-o", "-i", _boot(self.disk), f"::/{name}", self.folder / name], check=True
            )
        # Linux takes one number of a kind of serial port; a Pi 5's is 10.
        options = (self.folder / "cmdline.txt").read_text().strip().replace("ttyAMA10,115200", "ttyAMA0")
        # The memory that docs/hardware.md names: the check of a show may take a fifth of it.
        arguments = ["-machine", "virt,gic-version=2", "-cpu", "cortex-a72", "-m", "4096", "-append", options]
        return [*arguments, "-kernel", str(self.folder / "linux"), "-initrd", str(self.folder / "initrd")]


class Console:
    """The serial console: everything is read, and commands are typed."""

    def __init__(self, path: Path, log: Path) -> None:
        self.path, self.log = path, log
        self._line: socket.socket | None = None
        self._read = ""

    def plug_in(self, machine: subprocess.Popen[bytes]) -> None:
        while True:
            line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            try:
                line.connect(str(self.path))
            except OSError:
                line.close()
                if machine.poll() is not None:
                    raise RuntimeError(f"qemu ended at once with {machine.returncode}") from None
                time.sleep(0.05)
                continue
            self._line, self._read = line, ""
            return

    def unplug(self) -> None:
        if self._line is not None:
            self._line.close()
        self._line = None
        self.path.unlink(missing_ok=True)

    def wait_for(self, pattern: str, within_s: float) -> str:
        """Reads on until `pattern` (a regular expression) has been seen; returns what came up to its end."""
        assert self._line is not None, "the machine is off"
        deadline = time.monotonic() + within_s
        while (found := re.search(pattern, self._read)) is None:
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                raise TimeoutError(
                    f"no {pattern!r} within {within_s:.0f} s; the console: {self._read[-2000:]}"
                )
            self._line.settimeout(left_s)
            try:
                came = self._line.recv(65536)
            except TimeoutError:
                continue
            if not came:
                raise RuntimeError(f"the machine went off; the console: {self._read[-2000:]}")
            with self.log.open("ab") as log:
                log.write(came)
            self._read += came.decode(errors="replace").replace("\r", "")
        before, self._read = self._read[: found.end()], self._read[found.end() :]
        return before

    def type(self, text: str) -> None:
        assert self._line is not None, "the machine is off"
        self._line.sendall(text.encode())

    def log_in(self, within_s: float = 600.0) -> None:
        """Logs in as root, which the image allows at the rack."""
        self.wait_for(r"login: ", within_s)
        self.type("root\n")
        self.wait_for(r"# ", 120.0)
        self.type(f"export TERM=dumb PAGER=cat; stty -echo cols 200; PS1='{CONSOLE_PROMPT}'\n")
        self.wait_for(f"\n.*{CONSOLE_PROMPT}", 60.0)

    def run(self, command: str, within_s: float = 120.0) -> str:
        """What `command` prints, without its last line break."""
        self.type(command + "\n")
        printed = self.wait_for(re.escape(CONSOLE_PROMPT), within_s)
        return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", printed).removesuffix(CONSOLE_PROMPT).strip()


def disk_of(image: Path, folder: Path, size_mib: int, files: dict[str, bytes], options: str = "") -> Path:
    """A disk onto which `image` was written, larger than it.

    `files` go to the folder bunraku/ of its boot partition, `options` are added to the kernel's command line.
    """
    disk = folder / "disk.img"
    subprocess.run(["cp", "--sparse=always", image, disk], check=True)
    command_line = "::/cmdline.txt" if _is_pi(disk) else "::/grub/grub.cfg"
    kept = subprocess.run(
        ["mtype", "-i", _boot(disk), command_line], check=True, capture_output=True, text=True
    )
    text = kept.stdout.replace("\r", "").replace(" panic=", f" {options} panic=")
    for name, content in files.items():
        _put(disk, folder, f"::/bunraku/{name}", content)
    _put(disk, folder, command_line, text.encode())
    with disk.open("r+b") as grown:
        grown.truncate(size_mib * 1024 * 1024)
    return disk


def missing_programs(image: Path) -> list[str]:
    """What this machine lacks to run another one."""
    qemu = "qemu-system-aarch64" if "arm64" in image.name else "qemu-system-x86_64"
    return [name for name in (qemu, "mcopy", "mtype") if shutil.which(name) is None]


def _put(disk: Path, folder: Path, name: str, content: bytes) -> None:
    (folder / "file").write_bytes(content)
    subprocess.run(["mcopy", "-o", "-i", _boot(disk), folder / "file", name], check=True)


def _boot(disk: Path) -> str:
    return f"{disk}@@2M"


def _is_pi(disk: Path) -> bool:
    listed = ["mdir", "-b", "-i", _boot(disk), "::/config.txt"]
    return subprocess.run(listed, capture_output=True, check=False).returncode == 0


def _uefi() -> list[str]:
    """UEFI for a PC, where this machine has it; else it starts by BIOS."""
    known = (Path("/usr/share/ovmf/OVMF.fd"), Path("/usr/share/qemu/OVMF.fd"))
    found = next((path for path in known if path.exists()), None)
    return ["-drive", f"if=pflash,format=raw,readonly=on,file={found}"] if found else []
