"""Box and emulator as the real processes that a measurement runs: how they are started, heard and stopped."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hw_sim.osc_receiver import OscReceiver

HOST = "127.0.0.1"
STARTS_WITHIN_S = 60.0
ENDS_WITHIN_S = 10.0
FRAME = b"/bunraku/frame\0"
PRIORITY = 50  # below the box's: the receiver's clock readings matter, the box's ticks matter more
PORTS = range(20000, 32000)  # below Linux' net.ipv4.ip_local_port_range
_CHANCE = random.SystemRandom()  # whoever sets a seed, two runs beside each other do not choose the same
STEP_EVERY_S = 0.6
STEP_DEGREES = 40.0


class ProbeError(RuntimeError):
    """A run that could not be measured; the message says why and what to do."""


@dataclass(frozen=True)
class Setting:
    """What is measured: a show, settings of the venue's box file, the key file, whose way is followed.

    firmware: the compiled firmware is the sensor, instead of the one in Python.
    """

    show: Path
    box: dict[str, Any]
    keys: Path
    sensor: str
    joint: str
    scratch: Path
    firmware: bool = False


def play_command(setting: Setting, box: Path) -> list[str]:
    """The box."""
    return [sys.executable, "-m", "appliance.cli", "play", "--show", str(setting.show), "--box", str(box)]


def emulate_command(setting: Setting, port: int, log: Path, *options: str) -> list[str]:
    """The sensor that is followed, on a venue's network."""
    return [
        *(sys.executable, "-m", "hw_sim", "emulate", "--sensor", setting.sensor, "--keys", str(setting.keys)),
        *("--motion", "step", "--step-degrees", str(STEP_DEGREES), "--step-every", str(STEP_EVERY_S)),
        *("--host", HOST, "--port", str(port), "--network", "venue", "--log", str(log), *options),
        *(("--firmware",) if setting.firmware else ()),
    ]


def write_box_file(setting: Setting, folder: Path, ports: tuple[int, int, int], **own: object) -> Path:
    """The venue's limits and real-time settings with the run's own ports: sensors, control, frames."""
    sensors, control, frames = ports
    values = {
        "sensors": {"udp": {"host": HOST, "port": sensors}, "keys": str(setting.keys)},
        "outputs": {"osc": [{"host": HOST, "port": frames, "dialect": "ai-toolbox", "frame_message": True}]},
        "control": {"host": HOST, "port": control},
        "journal": {},
        "runtime": str(folder / "runtime"),
        **own,
    }
    path = folder / "box.yaml"
    path.write_text(yaml.safe_dump({**setting.box, **values}))
    return path


def first_frame(receiver: OscReceiver, stage: subprocess.Popen[bytes], words: Path) -> float:
    """Wait for it; when it arrived, monotonic seconds."""
    until = time.monotonic() + STARTS_WITHIN_S
    while time.monotonic() < until:
        for arrival, datagram in receiver.poll_datagrams(0.02):
            if datagram.startswith(FRAME):
                return arrival
        if stage.poll() is not None:
            raise ProbeError(f"The box does not dance:\n{words.read_text().strip()}")
    raise ProbeError(f"No frame came within {STARTS_WITHIN_S:g} s:\n{words.read_text().strip()}")


def first_reading(emulator: subprocess.Popen[bytes], log: Path, words: Path) -> None:
    """Wait for it; then the emulator stands for what it emulates: hardware that waits for no processor."""
    until = time.monotonic() + STARTS_WITHIN_S
    while not (log.exists() and log.read_bytes().count(b"\n") > 1):
        if emulator.poll() is not None or time.monotonic() > until:
            raise ProbeError(f"The emulator does not send:\n{words.read_text().strip()}")
        time.sleep(0.02)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(emulator.pid, os.SCHED_FIFO, os.sched_param(PRIORITY))


def stop(stage: subprocess.Popen[bytes], words: Path) -> None:
    """Ask the box to end. Raises ProbeError when it does not, or not well."""
    with contextlib.suppress(ProcessLookupError):
        stage.send_signal(signal.SIGTERM)
    try:
        status = stage.wait(ENDS_WITHIN_S)
    except subprocess.TimeoutExpired:
        raise ProbeError("The box does not end when it is asked to.") from None
    if status != 0:
        raise ProbeError(f"The box ended with status {status}:\n{words.read_text().strip()}")


@contextlib.contextmanager
def process(command: Sequence[str], words: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Runs inside; what it says goes into the file `words`."""
    with words.open("ab") as out:
        running = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT)
        try:
            yield running
        finally:
            running.terminate()
            try:
                running.wait(ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                running.kill()
                running.wait()


@contextlib.contextmanager
def listening_closely() -> Iterator[None]:
    """Real-time priority for the receiver, where it can be had; processes that it starts are ordinary."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except OSError:
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def free_ports(count: int, kind: socket.SocketKind = socket.SOCK_DGRAM) -> list[int]:
    """Ports that nobody uses just now, UDP ones as a rule; none that the kernel gives to who asks for any."""
    with contextlib.ExitStack() as opened:
        ports: list[int] = []
        while len(ports) < count:
            port = _CHANCE.choice(PORTS)
            one = opened.enter_context(socket.socket(socket.AF_INET, kind))
            with contextlib.suppress(OSError):  # somebody has it
                one.bind(("0.0.0.0", port))
                ports.append(port)
        return ports
