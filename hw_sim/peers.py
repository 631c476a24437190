"""Box and emulator as the real processes of a measurement: start, receive, stop."""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
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
# Below Linux' net.ipv4.ip_local_port_range; FIRST:STEP is this process's share of them, beside others.
_FIRST, _STEP = map(int, os.environ.get("BUNRAKU_PORTS", "0:1").split(":"))
PORTS = range(20000, 32000)[_FIRST::_STEP]
_CHANCE = random.SystemRandom()  # unseeded, so that two runs at once choose different ports
_PR_SET_PDEATHSIG = 1
STEP_EVERY_S = 0.6
STEP_DEGREES = 40.0


class ProbeError(RuntimeError):
    """A run that could not be measured; the message says why and what to do."""


@dataclass(frozen=True)
class Setting:
    """The subject of a measurement: a show, settings of the venue's box file, keys, the followed sensor and
    its joint.

    firmware: the sensor runs the compiled firmware instead of the one in Python. sounds: the show has
    strings and the venue lets them sound; cue: in which of its cues, "" any.
    """

    show: Path
    box: dict[str, Any]
    keys: Path
    sensor: str
    joint: str
    scratch: Path
    firmware: bool = False
    sounds: bool = False
    cue: str = ""


def play_command(setting: Setting, box: Path) -> list[str]:
    """The box, started as its unit does: without the parser of all commands (16 MB)."""
    return [sys.executable, "-m", "appliance.start", "play", "--show", str(setting.show), "--box", str(box)]


def project_command(box: Path) -> list[str]:
    """The projector, on the whole screen, with time stamps."""
    return [sys.executable, "-m", "appliance.cli", "project", "--box", str(box), "--fullscreen", "--stamp"]


def sound_command(box: Path) -> list[str]:
    """The strings, started as their unit does."""
    return [sys.executable, "-m", "appliance.start", "sound", "--box", str(box)]


def emulate_command(setting: Setting, port: int, log: Path, *options: str) -> list[str]:
    """The followed sensor, on a venue's network."""
    return [
        *(sys.executable, "-m", "hw_sim", "emulate", "--sensor", setting.sensor, "--keys", str(setting.keys)),
        *("--motion", "step", "--step-degrees", str(STEP_DEGREES), "--step-every", str(STEP_EVERY_S)),
        *("--host", HOST, "--port", str(port), "--network", "venue", "--log", str(log), *options),
        *(("--firmware",) if setting.firmware else ()),
    ]


def write_box_file(setting: Setting, folder: Path, ports: tuple[int, int, int], **own: object) -> Path:
    """The venue's limits and real-time settings with the run's own ports: sensors, control, frames.

    Its state and runtime folders are separate too; it serves no page and makes no sound. It hears no other
    box, no timecode and no MIDI, and keeps no opening hours: closed, it would stand still.
    """
    sensors, control, frames = ports
    values = {
        "sensors": {"udp": {"host": HOST, "port": sensors}, "keys": str(setting.keys)},
        "outputs": {"osc": [{"host": HOST, "port": frames, "dialect": "ai-toolbox", "frame_message": True}]},
        "control": {"host": HOST, "port": control},
        "journal": {},
        "runtime": str(folder / "runtime"),
        "state": str(folder / "state"),
        "console": None,
        "sound": None,
        **dict.fromkeys(("pair", "locked", "timecode", "midi", "hours")),
        **own,
    }
    path = folder / "box.yaml"
    path.write_text(yaml.safe_dump({**setting.box, **values}))
    return path


def first_frame(
    receiver: OscReceiver,
    stage: subprocess.Popen[bytes],
    output: Path,
    is_awaited: Callable[[bytes], bool] = lambda frame: True,
    what: str = "frame came",
) -> float:
    """Wait for the first frame that `is_awaited`. Returns its arrival, monotonic seconds."""
    until = time.monotonic() + STARTS_WITHIN_S
    while time.monotonic() < until:
        for arrival, datagram in receiver.poll_datagrams(0.02):
            if datagram.startswith(FRAME) and is_awaited(datagram):
                return arrival
        if stage.poll() is not None:
            raise ProbeError(f"The box does not dance:\n{output.read_text().strip()}")
    raise ProbeError(f"No {what} within {STARTS_WITHIN_S:g} s:\n{output.read_text().strip()}")


def first_reading(emulator: subprocess.Popen[bytes], log: Path, output: Path) -> None:
    """Wait for it; then give the emulator real-time priority, as hardware waits for no processor."""
    until = time.monotonic() + STARTS_WITHIN_S
    while not (log.exists() and log.read_bytes().count(b"\n") > 1):
        if emulator.poll() is not None or time.monotonic() > until:
            raise ProbeError(f"The emulator does not send:\n{output.read_text().strip()}")
        time.sleep(0.02)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(emulator.pid, os.SCHED_FIFO, os.sched_param(PRIORITY))


def stop(stage: subprocess.Popen[bytes], output: Path) -> None:
    """Stop the box. Raises ProbeError when it does not end, or ends with an error."""
    with contextlib.suppress(ProcessLookupError):
        stage.send_signal(signal.SIGTERM)
    try:
        status = stage.wait(ENDS_WITHIN_S)
    except subprocess.TimeoutExpired:
        raise ProbeError("The box does not end after SIGTERM.") from None
    if status != 0:
        raise ProbeError(f"The box ended with status {status}:\n{output.read_text().strip()}")


@contextlib.contextmanager
def scratch_folder(prefix: str) -> Iterator[Path]:
    """A temporary folder."""
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    try:
        yield folder
    finally:
        remove_folder(folder)


def remove_folder(folder: Path) -> None:
    """Remove a folder into which the companions of a killed box write their last meanwhile."""
    until = time.monotonic() + ENDS_WITHIN_S
    while folder.exists() and time.monotonic() < until:
        shutil.rmtree(folder, ignore_errors=True)
        time.sleep(0.02)


@contextlib.contextmanager
def process(
    command: Sequence[str], output: Path, environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Runs inside the context, and not longer than this process; its output goes into the file `output`."""
    with output.open("ab") as out:
        running = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            env=environment,
            preexec_fn=_end_with_parent,
        )
        try:
            yield running
        finally:
            running.terminate()
            try:
                running.wait(ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                running.kill()
                running.wait()


def _end_with_parent() -> None:
    """prctl(2): a measurement that is killed leaves no box and no sensor behind."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


@contextlib.contextmanager
def listening_closely() -> Iterator[None]:
    """Real-time priority for the receiver, if allowed; its child processes stay ordinary."""
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
    """Free ports, UDP by default, outside the range from which the kernel assigns."""
    with contextlib.ExitStack() as opened:
        ports: list[int] = []
        while len(ports) < count:
            port = _CHANCE.choice(PORTS)
            one = opened.enter_context(socket.socket(socket.AF_INET, kind))
            with contextlib.suppress(OSError):  # in use
                one.bind(("0.0.0.0", port))
                ports.append(port)
        return ports
