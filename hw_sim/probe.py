"""One measured run: the emulator and the box as real processes, and a receiver that listens closely."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from hw_sim.latency import Frame, Reading
from hw_sim.osc_receiver import OscReceiver, decode

STEP_EVERY_S = 0.6
STEP_DEGREES = 40.0
HOST = "127.0.0.1"
STARTS_WITHIN_S = 60.0
ENDS_WITHIN_S = 10.0
PLAYER_STOP = b"/player/stop\0\0\0\0,\0\0\0"
FRAME, POSE = b"/bunraku/frame\0", b"/mocap/0/joint/rot_local\0"
JOURNAL_MAGIC = b"bunraku journal 1\n"
PRIORITY = 50  # below the box's: the receiver's clock readings matter, the box's ticks matter more


class ProbeError(RuntimeError):
    """A run that could not be measured; the message says why and what to do."""


@dataclass(frozen=True)
class Setting:
    """What is measured: a show, settings of the venue's box file, the key file, whose way is followed."""

    show: Path
    box: dict[str, Any]
    keys: Path
    sensor: str
    joint: str
    scratch: Path


@dataclass(frozen=True)
class Course:
    """How one run goes. In its last `standing_s` the phrase stands still, so that steps show alone."""

    name: str
    seconds: float
    standing_s: float
    phase_lock: bool
    drift_ppm: float
    seed: int


@dataclass(frozen=True)
class Run:
    """What one run left behind; times in monotonic seconds."""

    frames: list[Frame]
    readings: list[Reading]
    ticks: NDArray[Any]
    sections: tuple[str, ...]
    rss_mb: float
    start_to_first_frame_s: float
    stood_from: float


def run(setting: Setting, course: Course) -> Run:
    """Start box and emulator, watch, stop both. Raises ProbeError when the box does not dance."""
    folder = setting.scratch / course.name
    folder.mkdir()
    sensors, control = _free_ports(2)
    with OscReceiver(HOST) as receiver, _close_listening():
        box = _box_file(setting, folder, course, (sensors, control, receiver.port))
        begun = time.monotonic()
        with _process(_play(setting, box), folder / "box.txt") as stage:
            first = _first_frame(receiver, stage, folder / "box.txt")
            emulate = _emulate(setting, folder, course, sensors)
            with _process(emulate, folder / "emulator.txt") as emulator:
                _first_reading(emulator, folder)
                datagrams, rss_mb, stood_from = _watch(receiver, stage, course, control)
            _stop(stage, folder / "box.txt")
    header, ticks = _read_journal(folder / "run.journal")
    return Run(
        frames=_frames(datagrams, header["joints"].index(setting.joint)),
        readings=_read_log(folder / "sent.csv", setting.sensor),
        ticks=ticks,
        sections=tuple(header["sections"]),
        rss_mb=rss_mb,
        start_to_first_frame_s=first - begun,
        stood_from=stood_from,
    )


def _play(setting: Setting, box: Path) -> list[str]:
    return [sys.executable, "-m", "appliance.cli", "play", "--show", str(setting.show), "--box", str(box)]


def _emulate(setting: Setting, folder: Path, course: Course, port: int) -> list[str]:
    return [
        *(sys.executable, "-m", "hw_sim", "emulate", "--sensor", setting.sensor, "--keys", str(setting.keys)),
        *("--motion", "step", "--step-degrees", str(STEP_DEGREES), "--step-every", str(STEP_EVERY_S)),
        *("--host", HOST, "--port", str(port), "--network", "venue", "--seed", str(course.seed)),
        *("--drift-ppm", str(course.drift_ppm), "--log", str(folder / "sent.csv")),
    ]


def _box_file(setting: Setting, folder: Path, course: Course, ports: tuple[int, int, int]) -> Path:
    """The venue's limits and real-time settings with the run's own ports."""
    sensors, control, frames = ports
    own = {
        "sensors": {"udp": {"host": HOST, "port": sensors}, "keys": str(setting.keys)},
        "outputs": {"osc": [{"host": HOST, "port": frames, "dialect": "ai-toolbox", "frame_message": True}]},
        "control": {"host": HOST, "port": control},
        "journal": {"file": "run.journal", "minutes": max(1.0, course.seconds / 60.0 + 0.5)},
        "phase_lock": course.phase_lock,
    }
    path = folder / "box.yaml"
    path.write_text(yaml.safe_dump({**setting.box, **own}))
    return path


def _first_frame(receiver: OscReceiver, stage: subprocess.Popen[bytes], words: Path) -> float:
    until = time.monotonic() + STARTS_WITHIN_S
    while time.monotonic() < until:
        for arrival, datagram in receiver.poll_datagrams(0.02):
            if datagram.startswith(FRAME):
                return arrival
        if stage.poll() is not None:
            raise ProbeError(f"The box does not dance:\n{words.read_text().strip()}")
    raise ProbeError(f"No frame came within {STARTS_WITHIN_S:g} s:\n{words.read_text().strip()}")


def _first_reading(emulator: subprocess.Popen[bytes], folder: Path) -> None:
    """Wait for it; then the emulator stands for what it emulates: hardware that waits for no processor."""
    log, until = folder / "sent.csv", time.monotonic() + STARTS_WITHIN_S
    while not (log.exists() and log.read_bytes().count(b"\n") > 1):
        if emulator.poll() is not None or time.monotonic() > until:
            raise ProbeError(f"The emulator does not send:\n{(folder / 'emulator.txt').read_text().strip()}")
        time.sleep(0.02)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(emulator.pid, os.SCHED_FIFO, os.sched_param(PRIORITY))


def _watch(
    receiver: OscReceiver, stage: subprocess.Popen[bytes], course: Course, control: int
) -> tuple[list[tuple[float, bytes]], float, float]:
    """Collect datagrams for the course's time; the box's memory (MB); since when the phrase stands."""
    datagrams: list[tuple[float, bytes]] = []
    rss_mb, end = 0.0, time.monotonic() + course.seconds
    stand_at, look_at, stood_from = end - course.standing_s, 0.0, float("inf")
    while (now := time.monotonic()) < end and stage.poll() is None:
        datagrams += receiver.poll_datagrams(0.05)
        if now >= look_at:
            rss_mb, look_at = max(rss_mb, _resident_mb(stage.pid)), now + 0.5
        if now >= stand_at and stood_from > now:
            stood_from = now
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as commander:
                commander.sendto(PLAYER_STOP, (HOST, control))
    return datagrams, rss_mb, stood_from


def _stop(stage: subprocess.Popen[bytes], words: Path) -> None:
    with contextlib.suppress(ProcessLookupError):
        stage.send_signal(signal.SIGTERM)
    try:
        status = stage.wait(ENDS_WITHIN_S)
    except subprocess.TimeoutExpired:
        raise ProbeError("The box does not end when it is asked to.") from None
    if status != 0:
        raise ProbeError(f"The box ended with status {status}:\n{words.read_text().strip()}")


@contextlib.contextmanager
def _process(command: Sequence[str], words: Path) -> Iterator[subprocess.Popen[bytes]]:
    with words.open("wb") as out:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT)
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextlib.contextmanager
def _close_listening() -> Iterator[None]:
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


def _frames(datagrams: Sequence[tuple[float, bytes]], joint: int) -> list[Frame]:
    """Frame messages, each with the held joint's rotation from the pose that follows it."""
    frames: list[Frame] = []
    mark: tuple[float, list[Any]] | None = None
    for arrival, datagram in datagrams:
        if datagram.startswith(FRAME):
            mark = arrival, list(decode(datagram)[0][1])
        elif datagram.startswith(POSE) and mark is not None:
            at, (tick, _, sequence, late) = mark
            numbers = decode(datagram)[0][1][4 * joint : 4 * joint + 4]
            frames.append(Frame(at, int(tick), int(sequence), bool(late), np.array(numbers, float)))
            mark = None
    return frames


def _read_log(path: Path, sensor: str) -> list[Reading]:
    with path.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["sensor"] == sensor and row["note"] == ""]
    return [
        Reading(
            int(row["sequence"]),
            float(row["sent_s"]),
            float(row["sampled_s"]),
            (float(row["w"]), float(row["x"]), float(row["y"]), float(row["z"])),
        )
        for row in rows
    ]


def _read_journal(path: Path) -> tuple[dict[str, Any], NDArray[Any]]:
    """The box's flight recorder, by what its header says of itself."""
    data = path.read_bytes()
    header = json.loads(data[len(JOURNAL_MAGIC) : data.index(b"\0")])
    record = np.dtype([(name, form, tuple(shape)) for name, form, shape in header["record"]])
    first = header["header_bytes"]
    count = min(header["capacity"], (len(data) - first) // record.itemsize)
    ring = np.frombuffer(data, record, count, first)
    ticks = ring[ring["written"] > 0]
    return header, ticks[np.argsort(ticks["written"], kind="stable")]


def _resident_mb(process: int) -> float:
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def _free_ports(count: int) -> list[int]:
    with contextlib.ExitStack() as opened:
        sockets = [
            opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(count)
        ]
        for one in sockets:
            one.bind((HOST, 0))
        return [one.getsockname()[1] for one in sockets]
