"""Measured runs: emulator and box as real processes, and a receiver with precise time stamps."""

from __future__ import annotations

import csv
import os
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hw_sim.emulated_sensor import REBOOT_S
from hw_sim.journal_reader import read_journal
from hw_sim.latency import Frame, Restart, SentReading
from hw_sim.osc_receiver import OscReceiver, decode
from hw_sim.peers import (
    FRAME,
    HOST,
    STARTS_WITHIN_S,
    ProbeError,
    Setting,
    emulate_command,
    first_frame,
    first_reading,
    free_ports,
    listening_closely,
    play_command,
    process,
    project_command,
    sound_command,
    stop,
    write_box_file,
)
from hw_sim.progress import LiveTransport, Progress
from hw_sim.screen import Picture, Screen, Watcher
from hw_sim.sound_card import Played, environment, read_played

POSE = b"/mocap/0/joint/rot_local\0"
_PLAYED = "played.raw"
STEADY_S = 1.0  # how long the box dances with the sensor before it is killed


@dataclass(frozen=True)
class Course:
    """Plan of one run. In its last `standing_s` the phrase stands still, so that only steps show.

    projects: a projector shows the dance on the screen, and its pictures are watched. sounds: the strings
    play on an emulated card. dances: the hand dances, in place of steps.
    """

    name: str
    seconds: float
    standing_s: float = 0.0
    phase_lock: bool = True
    drift_ppm: float = 0.0
    seed: int = 1
    reboot_every_s: float | None = None
    projects: bool = False
    sounds: bool = False
    dances: bool = False

    @property
    def switched_on(self) -> int:
        """How often the sensor is switched on, and off again before the run ends."""
        return round(self.seconds / (self.reboot_every_s + REBOOT_S)) if self.reboot_every_s else 0


@dataclass(frozen=True)
class Run:
    """The record of one run; times in monotonic seconds."""

    frames: list[Frame]
    readings: list[SentReading]
    ticks: NDArray[Any]
    sections: tuple[str, ...]
    rss_mb: float
    start_to_first_frame_s: float
    stood_from: float
    pictures: Sequence[Picture] = ()
    played: Played | None = None
    gaps: int = 0  # entries that the journal lost: ticks of which nothing is known


def run(setting: Setting, course: Course, progress: Progress | None = None) -> Run:
    """Start box and emulator, record, stop both; progress: hears of each reading meanwhile.

    Raises ProbeError when the box does not dance.
    """
    folder = setting.scratch / course.name
    folder.mkdir()
    sensors, control = free_ports(2)
    log, output = folder / "sent.csv", folder / "box.txt"
    with ExitStack() as opened:
        receiver = opened.enter_context(OscReceiver(HOST))
        screen = opened.enter_context(closing(Screen())) if course.projects else None
        opened.enter_context(listening_closely())
        if screen is not None:
            picture = {**setting.box.get("projector", {}), "size": list(screen.size)}
            setting = replace(setting, box={**setting.box, "projector": picture})
        if not course.phase_lock:
            limits = {**setting.box.get("limits", {}), "wait_ms": 0}
            setting = replace(setting, box={**setting.box, "limits": limits})
        box = write_box_file(
            *(setting, folder, (sensors, control, receiver.port)),
            journal={"folder": "run.journal", "minutes": max(1.0, course.seconds / 60.0 + 0.5)},
            phase_lock=course.phase_lock,
            sound=(setting.box.get("sound") or {}) if course.sounds else None,
        )
        begun = time.monotonic()
        with process(play_command(setting, box), output) as stage:
            first = first_frame(receiver, stage, output)
            emulate = emulate_command(setting, sensors, log, *_options(course))
            with process(emulate, folder / "emulator.txt") as emulator:
                first_reading(emulator, log, folder / "emulator.txt")
                live = LiveTransport(progress or Progress(None), log, setting.sensor)
                if course.sounds and setting.cue:
                    _order(control, "/cue", setting.cue)
                with _seen(screen, box, folder) as pictures, _heard(course, box, folder), closing(live):
                    datagrams, rss_mb, stood_from = _watch(receiver, stage, course, control, live)
            stop(stage, output)
    header, ticks, gaps = read_journal(folder / "run.journal")
    return Run(
        frames=_frames(datagrams, header["joints"].index(setting.joint)),
        readings=_read_log(log, setting.sensor),
        ticks=ticks,
        sections=tuple(header["sections"]),
        rss_mb=rss_mb,
        start_to_first_frame_s=first - begun,
        stood_from=stood_from,
        pictures=pictures,
        played=read_played(folder / _PLAYED) if course.sounds else None,
        gaps=gaps,
    )


@contextmanager
def _heard(course: Course, box: Path, folder: Path) -> Iterator[None]:
    """The strings play meanwhile, if the course wants them. Raises ProbeError where nothing is played."""
    if not course.sounds:
        yield
        return
    output, log = folder / "sound.txt", folder / _PLAYED
    with process(sound_command(box), output, environment(log)) as sound:
        until = time.monotonic() + STARTS_WITHIN_S
        while not (log.exists() and log.stat().st_size):
            if sound.poll() is not None or time.monotonic() > until:
                raise ProbeError(f"The strings play nothing:\n{output.read_text().strip()}")
            time.sleep(0.05)
        yield


@contextmanager
def _seen(screen: Screen | None, box: Path, folder: Path) -> Iterator[list[Picture]]:
    """The pictures that a projector shows on the screen meanwhile; without a screen there is no projector.

    Raises ProbeError where the projector shows no picture.
    """
    if screen is None:
        yield []
        return
    output = folder / "projector.txt"
    with process(project_command(box), output) as projector:
        watcher = Watcher(screen)
        watcher.start()
        until = time.monotonic() + STARTS_WITHIN_S
        try:
            while not watcher.pictures:
                if projector.poll() is not None or time.monotonic() > until:
                    raise ProbeError(f"The projector shows no picture:\n{output.read_text().strip()}")
                time.sleep(0.05)
            yield watcher.pictures
        finally:
            watcher.stop()


def run_restarts(setting: Setting, times: int) -> list[Restart]:
    """Kill and restart the box `times` times while the sensor keeps running. Raises ProbeError."""
    folder = setting.scratch / "restarts"
    folder.mkdir()
    sensors, control = free_ports(2)
    log, output = folder / "sent.csv", folder / "box.txt"
    restarts = []
    with OscReceiver(HOST) as receiver, listening_closely():
        box = write_box_file(setting, folder, (sensors, control, receiver.port))
        with process(emulate_command(setting, sensors, log), folder / "emulator.txt") as emulator:
            killed_at: float | None = None
            for _ in range(times + 1):
                receiver.poll_datagrams()  # the last frames of the box before
                started_at = time.monotonic()
                with process(play_command(setting, box), output) as stage:
                    used_at = first_frame(receiver, stage, output, _has_reading, "reading was used")
                    if killed_at is not None:
                        restarts.append(Restart(killed_at, started_at, used_at))
                    else:
                        first_reading(emulator, log, folder / "emulator.txt")
                    time.sleep(STEADY_S)
                    killed_at = time.monotonic()
                    stage.kill()
    return restarts


def _options(course: Course) -> list[str]:
    options = ["--seed", str(course.seed), "--drift-ppm", str(course.drift_ppm)]
    options += ["--motion", "dance"] if course.dances else []
    return options + (["--reboot-every", str(course.reboot_every_s)] if course.reboot_every_s else [])


def _watch(
    receiver: OscReceiver,
    stage: subprocess.Popen[bytes],
    course: Course,
    control: int,
    live: LiveTransport,
) -> tuple[list[tuple[float, bytes]], float, float]:
    """Collect datagrams for the course. Returns them, the box's memory (MB) and when the phrase stopped."""
    datagrams: list[tuple[float, bytes]] = []
    rss_mb, end = 0.0, time.monotonic() + course.seconds
    stand_at, look_at, stood_from = end - course.standing_s, 0.0, float("inf")
    while (now := time.monotonic()) < end and stage.poll() is None:
        came = receiver.poll_datagrams(0.05)
        datagrams += came
        live.look(came)
        if now >= look_at:
            rss_mb, look_at = max(rss_mb, _resident_mb(stage.pid)), now + 0.5
        if now >= stand_at and stood_from > now:
            stood_from = now
            _order(control, "/player/stop")
    return datagrams, rss_mb, stood_from


def _order(port: int, address: str, *output: str) -> None:
    """Send an OSC message of strings."""
    texts = [address, "," + "s" * len(output), *output]
    padded = [text.encode() + b"\0" * (4 - len(text.encode()) % 4) for text in texts]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as commander:
        commander.sendto(b"".join(padded), (HOST, port))


def _frames(datagrams: Sequence[tuple[float, bytes]], joint: int) -> list[Frame]:
    """Frame messages, each with the held joint's rotation from the pose that follows it."""
    frames: list[Frame] = []
    mark: tuple[float, list[Any]] | None = None
    for arrival, datagram in datagrams:
        if datagram.startswith(FRAME):
            mark = arrival, _mark(datagram)
        elif datagram.startswith(POSE) and mark is not None:
            at, (tick, _, sequence, late, _) = mark
            numbers = decode(datagram)[0][1][4 * joint : 4 * joint + 4]
            frames.append(Frame(at, int(tick), int(sequence), bool(late), np.array(numbers, float)))
            mark = None
    return frames


def _has_reading(datagram: bytes) -> bool:
    return bool(_mark(datagram)[2] >= 0)


def _mark(datagram: bytes) -> list[Any]:
    """A frame message's tick, second, sensor sequence, late, rest of the second."""
    return list(decode(datagram)[0][1])


def _read_log(path: Path, sensor: str) -> list[SentReading]:
    with path.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["sensor"] == sensor and row["note"] == ""]
    return [
        SentReading(
            int(row["sequence"]),
            float(row["sent_s"]),
            float(row["sampled_s"]),
            (float(row["w"]), float(row["x"]), float(row["y"]), float(row["z"])),
            float(row["power_on_s"]),
        )
        for row in rows
    ]


def _resident_mb(process: int) -> float:
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGESIZE") / 1e6
