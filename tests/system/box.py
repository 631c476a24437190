"""The real box as a process of its own, with its own ports and a receiver that listens."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from appliance.sensor.keys import SensorKey, create_keys
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import HOST, free_ports
from tests.system.processes import BUNRAKU, PATIENCE_S, await_that, children_that_say, says, started

PLAY = (*BUNRAKU, "play")
JOURNAL = {"journal": {"folder": "run.journal", "minutes": 1}}


@dataclass
class Box:
    """A running `bunraku play`; `sensors` and `control` are its ports, `words` what it says."""

    process: subprocess.Popen[bytes]
    receiver: OscReceiver
    sensors: int
    control: int
    keys: dict[str, SensorKey]
    words_file: Path
    command: list[str]

    @property
    def key(self) -> SensorKey:
        """Of the only or first sensor."""
        return next(iter(self.keys.values()))

    @property
    def words(self) -> str:
        return self.words_file.read_text()

    def frames(self, count: int) -> list[list[Any]]:
        """The next `count` frame messages: tick, frame time, sensor sequence, late."""
        found: list[list[Any]] = []
        until = time.monotonic() + PATIENCE_S
        while len(found) < count:
            assert time.monotonic() < until, self.words
            assert self.process.poll() is None or found, self.words
            found += [arguments for _, address, arguments in self.receiver.poll(0.05) if "frame" in address]
        return found

    def last_frames(self) -> list[list[Any]]:
        """Those that the process, which has ended, had sent and the test has not taken yet."""
        return [arguments for _, address, arguments in self.receiver.poll() if "frame" in address]

    def frame_that(self, is_wanted: Callable[[list[Any]], bool]) -> list[Any]:
        """The next frame message that is as wanted."""
        until = time.monotonic() + PATIENCE_S
        while True:
            for frame in self.frames(1):
                if is_wanted(frame):
                    return frame
            assert time.monotonic() < until, self.words

    def await_words(self, words: str, count: int = 1) -> None:
        """Until it has said this so often."""
        until = time.monotonic() + PATIENCE_S
        while self.words.count(words) < count:
            assert time.monotonic() < until and self.process.poll() is None, self.words
            self.receiver.poll(0.05)

    def kill_and_restart(self) -> None:
        """As systemd does it: gone in the middle of a tick, and the same command again."""
        self.end(signal.SIGKILL)
        self.receiver.poll()
        with self.words_file.open("ab") as words:
            self.process = started(self.command, words)

    def end(self, number: int = signal.SIGTERM) -> int:
        """Send a signal and give the exit status.

        Show control of a killed box ends by itself: while it holds the port, the next box would be refused.
        """
        companions = children_that_say(self.process.pid, "appliance.show_control")
        with ending_emulators(self.process.pid):
            self.process.send_signal(number)
            status = self.process.wait(PATIENCE_S)
        await_that(
            lambda: not any(says(pid, "appliance.show_control") for pid in companions), lambda: self.words
        )
        return status


@contextlib.contextmanager
def playing(
    show: Path,
    folder: Path,
    *arguments: str,
    settings: dict[str, Any] | None = None,
    more_receivers: Sequence[dict[str, Any]] = (),
    command: Sequence[str] = PLAY,
    names: Sequence[str] = ("left-wrist",),
) -> Iterator[Box]:
    """A box that dances this show, with these sensors in its key file; `settings` go over its own."""
    keys = create_keys(folder / "sensors.keys", names)
    sensors, control = free_ports(2)
    with OscReceiver(HOST) as receiver, (folder / "words.txt").open("wb") as words:
        frames = {"host": HOST, "port": receiver.port, "frame_message": True}
        box: dict[str, Any] = {
            "sensors": {"udp": {"host": HOST, "port": sensors}, "keys": "sensors.keys"},
            "outputs": {"osc": [*more_receivers, frames]},
            "control": {"host": HOST, "port": control},
            "runtime": "runtime",
        }
        for section, values in (settings or {}).items():
            box[section] = {**box.get(section, {}), **values} if section in ("sensors", "outputs") else values
        (folder / "box.yaml").write_text(yaml.safe_dump(box))
        full = [*command, "--show", str(show), "--box", str(folder / "box.yaml"), *arguments]
        process = started(full, words)
        running = Box(process, receiver, sensors, control, keys, folder / "words.txt", full)
        try:
            yield running
        finally:
            with ending_emulators(running.process.pid):
                running.process.kill()
                running.process.wait()


@contextlib.contextmanager
def ending_emulators(box: int) -> Iterator[None]:
    """A box that is killed inside leaves its emulated sensors behind."""
    emulators = children_that_say(box, "emulate")
    yield
    for pid in emulators:
        if says(pid, "emulate"):
            os.kill(pid, signal.SIGKILL)


def await_end_of_keeper(runtime: Path) -> None:
    """It ends with its box and lets go of its lock; a power cut would have taken it in the same moment."""

    def is_gone() -> bool:
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        return False

    with (runtime / "keeper.lock").open() as lock:
        await_that(is_gone, "the keeper outlives its box")


def is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind((HOST, port))
        except OSError:
            return False
        return True
