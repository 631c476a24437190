"""The real box as a process, with its own ports and an OSC receiver."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from appliance.box.checkpoint import Checkpoint, packed
from appliance.box.record import SlotFile
from appliance.sensor.keys import SensorKey, create_keys
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import HOST, free_ports, remove_folder
from tests.standing import read_checkpoint
from tests.system.processes import (
    BUNRAKU,
    Process,
    children_running,
    descendants,
    has_argument,
    is_running,
    run_bunraku,
    wait_until,
)
from tests.system.wearables import Wearables

PLAY = (*BUNRAKU, "play")
JOURNAL = {"journal": {"folder": "run.journal", "minutes": 1}}


class Box(Process):
    """A running `bunraku play`; `sensors` and `control` are its ports."""

    def __init__(
        self,
        folder: Path,
        command: Sequence[str | Path],
        receiver: OscReceiver,
        ports: tuple[int, int],
        keys: dict[str, SensorKey],
    ) -> None:
        self.box_file, self.runtime = folder / "box.yaml", folder / "runtime"
        self.receiver, self.keys = receiver, keys
        self.sensors, self.control = ports
        super().__init__(folder / "words.txt", command)

    @property
    def key(self) -> SensorKey:
        """Of the only or first sensor."""
        return next(iter(self.keys.values()))

    def wearables(self, **options: Any) -> Wearables:
        """All sensors of the key file, as emulated wearables, once the box runs; a context."""
        self.frames(1)
        return Wearables(list(self.keys.values()), self.sensors, **options)

    def frames(self, count: int) -> list[list[Any]]:
        """The next `count` frame messages: tick, second, sensor sequence, late, rest of the second."""
        found: list[list[Any]] = []

        def has_all() -> bool:
            arrived = [arguments for _, address, arguments in self.receiver.poll(0.05) if "frame" in address]
            assert arrived or found or self.process.poll() is None, self.output
            found.extend(arrived)
            return len(found) >= count

        wait_until(has_all, lambda: self.output, pause=lambda: None)
        return found

    def last_frames(self) -> list[list[Any]]:
        """Frame messages that the ended process had sent and the test has not taken yet."""
        return [arguments for _, address, arguments in self.receiver.poll() if "frame" in address]

    def frame_that(self, is_wanted: Callable[[list[Any]], bool]) -> list[Any]:
        """The next frame message that is as wanted."""
        return wait_until(
            lambda: next(filter(is_wanted, self.frames(1)), None), lambda: self.output, pause=lambda: None
        )

    def pause(self) -> None:
        """Frames that arrive meanwhile are dropped: what a test reads next is new."""
        self.receiver.poll(0.05)

    def listed_sensors(self) -> dict[str, dict[str, Any]]:
        """What `bunraku sensors --json` lists, by name."""

        def answer() -> dict[str, Any]:
            done = run_bunraku("sensors", "--json", "--box", self.box_file)
            assert done.returncode == 0, done.stderr
            listed: dict[str, Any] = json.loads(done.stdout)
            return listed if listed["box"] else {}

        return {sensor["name"]: sensor for sensor in wait_until(answer, lambda: self.output)["sensors"]}

    def kill_and_restart(self) -> None:
        """As systemd does it: killed in the middle of a tick, then the same command again."""
        self.end(signal.SIGKILL)
        self.receiver.poll()
        self.start()

    def end(self, number: int = signal.SIGTERM) -> int:
        """Send a signal and return the exit status, once the box's show control has let go of its port."""
        companions = children_running(self.process.pid, "appliance.show_control")
        with ending_emulators(self.process.pid):
            status = super().end(number)
        wait_until(
            lambda: not any(has_argument(pid, "appliance.show_control") for pid in companions),
            lambda: f"show control outlives its box:\n{self.output}",
        )
        return status

    def end_whole(self) -> None:
        """Kill it, and wait until its other processes have ended too, as by a power cut."""
        everything = descendants(self.process.pid)
        self.end(signal.SIGKILL)
        wait_until(lambda: not any(map(is_running, everything)), "a process outlives its box")

    def kill(self) -> None:
        with ending_emulators(self.process.pid):
            super().kill()


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
    """A box that dances this show, with these sensors in its key file; `settings` override its own."""
    keys = create_keys(folder / "sensors.keys", names)
    sensors, control = free_ports(2)
    with OscReceiver(HOST) as receiver:
        frames = {"host": HOST, "port": receiver.port, "frame_message": True}
        box: dict[str, Any] = {
            "sensors": {"udp": {"host": HOST, "port": sensors}, "keys": "sensors.keys"},
            "outputs": {"osc": [*more_receivers, frames]},
            "control": {"host": HOST, "port": control},
            "console": None,  # a process less: tests/console has it
            "runtime": "runtime",
        }
        for section, values in (settings or {}).items():
            box[section] = {**box.get(section, {}), **values} if section in ("sensors", "outputs") else values
        (folder / "box.yaml").write_text(yaml.safe_dump(box))
        full = [*command, "--show", show, "--box", folder / "box.yaml", *arguments]
        with Box(folder, full, receiver, (sensors, control), keys) as running:
            yield running


@contextlib.contextmanager
def ending_emulators(box: int) -> Iterator[None]:
    """A box that is killed leaves its emulated sensors behind: kill those too."""
    emulators = children_running(box, "emulate")
    yield
    for pid in emulators:
        if has_argument(pid, "emulate"):
            os.kill(pid, signal.SIGKILL)


def cut_power(box: Box, file: Path) -> Checkpoint:
    """What a power cut takes is gone: processes, the runtime folder, this boot. The place on the disk."""
    box.end_whole()
    remove_folder(box.runtime)
    place = read_checkpoint(file)
    assert place is not None
    with closing(SlotFile(file)) as slots:
        slots.write(packed(replace(place, boot="of another boot")))
    return place


def is_free(port: int) -> bool:
    """Whether nothing is bound to this UDP port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind((HOST, port))
        except OSError:
            return False
        return True
