"""A whole venue in its own network: the box, a sensor, a projector, and receivers."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from appliance.sensor.keys import create_keys
from appliance.show.bundle import default_show_path, write_checksums
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import HOST, free_ports
from hw_sim.posistagenet import PsnReceiver
from tests.system import namespace, olad
from tests.system.namespace import Namespace
from tests.system.olad import Olad
from tests.system.processes import BUNRAKU, PATIENCE_S, children_running, start, wait_until

SENSOR = "left-wrist"
STAND_STILL_S = 20.0  # the neutral pose takes 1.5 s, and starts over at each pause of a busy machine
LAMPS = {1: ("lHand", 2.0), 2: ("rFoot", 1.0)}  # universe: the joint whose height it shows, metres of full
ART_NET_IN = {"2-1-I-0": 1, "2-1-I-1": 2}


def why_not() -> str | None:
    """Why a venue cannot be built here; None if it can."""
    if shutil.which("oscdump") is None:
        return "oscdump (Debian package liblo-tools) is missing"
    return olad.why_not() or namespace.why_not()


@dataclass
class Venue:
    """All that runs. `processes`: by name; `dump`: the output of oscdump; `ports`: of the receivers."""

    folder: Path
    network: Namespace
    daemon: Olad
    osc: dict[str, OscReceiver]
    positions: PsnReceiver
    dump: Path
    ports: dict[str, int]
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def output(self, name: str) -> str:
        """The output of a process so far."""
        return (self.folder / f"{name}.txt").read_text(errors="replace")

    def pids(self) -> dict[str, int]:
        """All process ids by name, including the stage's companions."""
        found = {name: process.pid for name, process in self.processes.items()}
        for name, word in (("control", "appliance.show_control"), ("lights", "lights")):
            for pid in children_running(found["stage"], word):
                found[name] = pid
        return found

    def lost(self, name: str) -> int:
        """Datagrams that the box sent and the kernel dropped, because the receiver's socket was full."""
        with self.network.entered():
            return sum(int(row.split()[-1]) for row in _sockets(self.ports[name]))

    def end(self) -> dict[str, int]:
        """End the box's own processes and return their exit statuses."""
        own = {name: self.processes[name] for name in ("sensor", "projector", "stage")}
        for process in own.values():
            process.terminate()
        return {name: process.wait(PATIENCE_S) for name, process in own.items()}


@contextlib.contextmanager
def venue(folder: Path, picture: str = "320x180") -> Iterator[Venue]:
    """Start it all, the receivers before the box. picture: the projector's size, pixels."""
    show = lit_show(folder / "show")
    create_keys(folder / "sensors.keys", [SENSOR])
    with contextlib.ExitStack() as opened:
        network = opened.enter_context(Namespace("venue"))
        daemon = opened.enter_context(Olad(olad.art_net_node(), ART_NET_IN, network))
        with network.entered():
            osc = {
                dialect: opened.enter_context(contextlib.closing(OscReceiver(HOST)))
                for dialect in ("ai-toolbox", "vmc")
            }
            dump_port, psn_port, sensors, control = free_ports(4)
            psn = opened.enter_context(PsnReceiver(HOST, HOST, psn_port))
        receivers = [
            {"host": HOST, "port": receiver.port, "dialect": dialect, "frame_message": True}
            for dialect, receiver in osc.items()
        ]
        receivers.append({"host": HOST, "port": dump_port, "dialect": "joint", "frame_message": True})
        box = folder / "box.yaml"
        settings = {
            "runtime": "runtime",
            "sensors": {"udp": {"host": HOST, "port": sensors}, "keys": "sensors.keys"},
            "control": {"host": HOST, "port": control},
            "outputs": {
                "osc": receivers,
                "posistagenet": [{"host": HOST, "port": psn_port}],
                "dmx": [{"universe": universe, "wire": "artnet"} for universe in LAMPS],
            },
        }
        box.write_text(yaml.safe_dump(settings))
        ports = {dialect: receiver.port for dialect, receiver in osc.items()}
        ports |= {"oscdump": dump_port, "PosiStageNet": psn_port}
        running = Venue(folder, network, daemon, osc, psn, folder / "oscdump.txt", ports)
        _dump(running, opened)
        stage = [*BUNRAKU, "play", "--show", str(show), "--box", str(box)]
        emulator = [sys.executable, "-m", "hw_sim", "emulate", "--sensor", SENSOR, "--motion", "dance"]
        emulator += ["--stand-still", str(STAND_STILL_S)]
        emulator += ["--keys", str(folder / "sensors.keys"), "--port", str(sensors)]
        projector = [*BUNRAKU, "project", "--box", str(box), "--offscreen", picture]
        for name, arguments in (("stage", stage), ("sensor", emulator), ("projector", projector)):
            running.processes[name] = _start(opened, network.command(*arguments), folder / f"{name}.txt")
        yield running


def lit_show(folder: Path) -> Path:
    """The default show with one lamp in each of two universes, as bright as a joint is high."""
    shutil.copytree(default_show_path(), folder)
    show = yaml.safe_load((folder / "show.yaml").read_text())
    show["lights"] = {
        "fixtures": [
            {"name": f"lamp {universe}", "profile": "dimmer", "universe": universe, "address": 1}
            for universe in LAMPS
        ],
        "mappings": [
            {
                "name": "heights",
                "rules": [
                    {
                        "fixtures": [f"lamp {universe}"],
                        "reads": "height",
                        "joint": joint,
                        "drives": "dimmer",
                        "range": [0.0, full],
                    }
                    for universe, (joint, full) in LAMPS.items()
                ],
            }
        ],
    }
    (folder / "show.yaml").write_text(yaml.safe_dump(show))
    write_checksums(folder)
    return folder


def _dump(running: Venue, opened: contextlib.ExitStack) -> None:
    """Start the real oscdump and keep its lines about frames."""
    port = running.ports["oscdump"]
    with running.dump.open("wb") as kept:
        dump = subprocess.Popen(running.network.command("oscdump", str(port)), stdout=subprocess.PIPE)
        opened.callback(_stop, dump)
        keep = subprocess.Popen(["grep", "--line-buffered", "/bunraku/frame"], stdin=dump.stdout, stdout=kept)
        opened.callback(_stop, keep)
    running.processes["oscdump"] = dump
    with running.network.entered():
        wait_until(lambda: dump.poll() is not None or _sockets(port), "oscdump does not listen")
    assert dump.poll() is None, "oscdump has ended"


def _sockets(port: int) -> list[str]:
    """The kernel's lines about sockets bound to this UDP port, in the network of this thread."""
    tables = [Path(f"/proc/thread-self/net/{table}").read_text().splitlines() for table in ("udp", "udp6")]
    return [row for rows in tables for row in rows if row.split()[1].endswith(f":{port:04X}")]


def _start(opened: contextlib.ExitStack, command: Sequence[str], output: Path) -> subprocess.Popen[bytes]:
    with output.open("wb") as out:
        process = start(command, out)
    opened.callback(_stop, process)
    return process


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
