"""The soak itself: starts everything, lets happen what the script says, looks each second, ends it all."""

from __future__ import annotations

import contextlib
import shutil
import signal
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from hw_sim.dmx.artnet import ArtNetReceiver
from hw_sim.peers import HOST, STARTS_WITHIN_S, ProbeError, free_ports
from hw_sim.soak.box import LATE_MS, LOAD, Ears, SoakedBox
from hw_sim.soak.desk import Desk, Said
from hw_sim.soak.frames import FrameWatch
from hw_sim.soak.script import LOADS, Act, script
from hw_sim.soak.unit import Unit
from hw_sim.soak.viewers import Viewers
from hw_sim.soak.vitals import Vitals, warmest_c
from hw_sim.soak.wakeups import Wakeups

GUESTS = 3
_LOOK_S = 0.05
_ENDS_WITHIN_S = 10.0


@dataclass
class Second:
    """One look at everything; `at`: seconds of the run."""

    at: float
    load: str
    temperature_c: float | None
    held: dict[str, Vitals]


@dataclass
class Soak:
    """Results of a soak so far; `seconds` is how long it has been dancing."""

    box: SoakedBox
    frames: FrameWatch
    wakeups: Wakeups
    desk: Desk
    lamps: ArtNetReceiver
    viewers: Viewers
    timecode: socket.socket
    planned_s: float
    begun: float = 0.0
    seconds: float = 0.0
    load: str = "none"
    load_is_missing: bool = False  # it was wanted, and there is no stress-ng
    load_deaths: int = 0
    network: str = "venue"
    universes: int = 0
    timecodes: int = 0
    guest_changes: int = 0
    outages: int = 0
    said_before: Said | None = None
    looks: list[Second] = field(default_factory=list)
    guests: dict[int, socket.socket] = field(default_factory=dict)

    def close(self) -> None:
        """End every process and free every port."""
        self.wakeups.close()
        self.viewers.close()
        for guest in (*self.guests.values(), self.timecode):
            guest.close()
        for unit in self.box.everything:
            unit.ask_to_end()
        for unit in self.box.everything:
            unit.end(_ENDS_WITHIN_S)
        for one in (self.frames, self.desk, self.lamps):
            one.close()
        shutil.rmtree(self.box.runtime, ignore_errors=True)


def soak(
    show: Path,
    folder: Path,
    seconds: float,
    seed: int,
    load: bool,
    stopped: Callable[[], bool],
    each_second: Callable[[Soak], None],
) -> Soak:
    """Run until the seconds are over or `stopped`; what was seen. Raises ProbeError where nothing dances."""
    shutil.rmtree(folder, ignore_errors=True)
    ports = tuple(free_ports(GUESTS))
    with ExitStack() as opened:
        frames, desk, lamps = FrameWatch(LATE_MS), Desk(seed), ArtNetReceiver(HOST)
        timecode = _bound_to(0)
        ears = Ears(frames.port, desk.port, lamps.port, timecode.getsockname()[1], ports)
        box = SoakedBox(show, folder, ears)
        soak = Soak(box, frames, Wakeups(), desk, lamps, Viewers(box.page_port), timecode, seconds)
        opened.callback(soak.close)
        _await_first_frame(soak, stopped)
        companions = [unit.name for unit in box.units[1:]]
        soak.load_is_missing = load and shutil.which("stress-ng") is None
        acts = script(seconds, companions, GUESTS, seed, load and not soak.load_is_missing)
        _dance(soak, acts, ports, stopped, each_second)
        soak.frames.end(time.monotonic())
        _change_load(soak, "none")
    return soak


def _await_first_frame(soak: Soak, stopped: Callable[[], bool]) -> None:
    until = time.monotonic() + STARTS_WITHIN_S
    while soak.frames.newest is None and not stopped():
        now = time.monotonic()
        _look_after(soak, now)
        soak.frames.poll(_LOOK_S)
        if now > until or soak.box.stage.deaths:
            output = soak.box.stage.output.read_text().strip()
            raise ProbeError(f"The box does not dance:\n{output}")


def _dance(
    soak: Soak,
    acts: list[Act],
    ports: tuple[int, ...],
    stopped: Callable[[], bool],
    each_second: Callable[[Soak], None],
) -> None:
    """Until its time is over. Everything that was before is forgotten: it was the start."""
    soak.begun = now = time.monotonic()
    soak.frames.start(now)
    soak.wakeups.start(now)
    soak.viewers.start()
    look_at, happened = now + 1.0, 0
    while soak.seconds < soak.planned_s and not stopped():
        soak.frames.poll(_LOOK_S)
        now = time.monotonic()
        soak.seconds = now - soak.begun
        soak.wakeups.poll(now)
        soak.desk.poll()
        soak.universes += len(soak.lamps.poll())
        soak.timecodes += _drain(soak.timecode)
        soak.said_before = soak.said_before or soak.desk.said
        for guest in soak.guests.values():
            _drain(guest)
        while happened < len(acts) and acts[happened].at <= soak.seconds:
            _happen(soak, acts[happened], ports)
            happened += 1
        _look_after(soak, now)
        if now >= look_at:
            look_at += 1.0 if now < look_at + 1.0 else now - look_at + 1.0
            held = {unit.name: unit.sample(now) for unit in soak.box.units}
            alive = {name: vitals for name, vitals in held.items() if vitals is not None}
            soak.looks.append(Second(soak.seconds, soak.load, warmest_c(), alive))
            each_second(soak)


def _look_after(soak: Soak, now: float) -> None:
    for unit in soak.box.everything:
        unit.update(now)


def _happen(soak: Soak, act: Act, ports: tuple[int, ...]) -> None:
    box = soak.box
    if act.kind == "command":
        soak.desk.command(box.control_port)
    elif act.kind == "guest":
        soak.guest_changes += 1
        _come_or_go(soak, int(act.which), ports)
    elif act.kind == "outage":
        soak.outages += 1
        box.sensors.kill(signal.SIGSTOP)
    elif act.kind == "back":
        box.sensors.kill(signal.SIGCONT)
    elif act.kind == "network":
        soak.network = act.which
        box.sensors.replace(box.emulation(act.which))
    elif act.kind == "kill":
        next(unit for unit in box.units if unit.name == act.which).kill()
    elif act.kind == "load":
        _change_load(soak, act.which)


def _come_or_go(soak: Soak, which: int, ports: tuple[int, ...]) -> None:
    """A receiver that was there goes, one that was not comes."""
    if (gone := soak.guests.pop(which, None)) is not None:
        gone.close()
        return
    with contextlib.suppress(OSError):
        soak.guests[which] = _bound_to(ports[which])


def _bound_to(port: int) -> socket.socket:
    """A receiver on this port; 0: any free one."""
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.setblocking(False)
    try:
        receiver.bind((HOST, port))
    except OSError:
        receiver.close()
        raise
    return receiver


def _drain(receiver: socket.socket) -> int:
    """How many datagrams were waiting."""
    count = 0
    with contextlib.suppress(BlockingIOError):
        while True:
            receiver.recv(65536)
            count += 1
    return count


def _change_load(soak: Soak, name: str) -> None:
    soak.load = name
    if soak.box.load is not None:
        soak.load_deaths += soak.box.load.deaths
        soak.box.load.end(_ENDS_WITHIN_S)
        soak.box.load = None
    options = dict(LOADS)[name]
    if options:
        temporary = ("--temp-path", str(soak.box.folder))
        soak.box.load = Unit(LOAD, ("stress-ng", *options, *temporary), soak.box.output / LOAD)
