"""The box under test: its processes one by one, as its units start them, in a separate folder."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from appliance.sensor.keys import create_keys
from hw_sim.peers import HOST, PRIORITY, free_ports
from hw_sim.soak.unit import Unit

STAGE, EMULATOR, LOAD = "stage", "sensors", "load"
JOURNAL_MINUTES = 10  # shorter than the soak, so that old segments have to go
LATE_MS = 15.0  # limits: late_ms: of the box file, as it is by default
_PICTURE = "320x180"  # the projector's: without a graphics card the processor draws, which is load enough


class Ears(NamedTuple):
    """Ports of this machine on which the soak receives from the box."""

    frames: int
    heartbeat: int
    lamps: int
    timecode: int
    guests: tuple[int, ...]


class SoakedBox:
    """`units`: the box's own processes. `sensors`: the emulated ones. `load`: stress-ng, where any runs."""

    def __init__(self, show: Path, folder: Path, ears: Ears) -> None:
        self.folder, self.runtime = folder, Path(f"/dev/shm/bunraku-soak-{os.getpid()}")
        self.output = folder / "output"
        self.output.mkdir(parents=True)
        self.show = _with_lamps(show, folder / "show")
        self.sensor_port, self.control_port, self.page_port = free_ports(3)
        self._keys = folder / "sensors.keys"
        create_keys(self._keys, sensors_of(show))
        self.box_file = folder / "box.yaml"
        self.box_file.write_text(yaml.safe_dump(self._settings(ears)))
        environment = {name: value for name, value in os.environ.items() if name != "RUNTIME_DIRECTORY"}
        self.units = [
            Unit(name, (sys.executable, "-m", "appliance.cli", *arguments), self.output / name, environment)
            for name, arguments in self._processes()
        ]
        self.sensors = Unit(
            *(EMULATOR, self.emulation("venue"), self.output / EMULATOR, environment),
            priority=PRIORITY,  # they stand for hardware, which waits for no processor
        )
        self.load: Unit | None = None

    @property
    def stage(self) -> Unit:
        """The one that dances."""
        return self.units[0]

    @property
    def everything(self) -> Iterator[Unit]:
        """All that runs."""
        yield from (*self.units, self.sensors)
        if self.load is not None:
            yield self.load

    def emulation(self, network: str) -> tuple[str, ...]:
        """The sensors on such a network."""
        return (
            *(sys.executable, "-m", "hw_sim", "emulate", "--keys", str(self._keys), "--motion", "dance"),
            *("--host", HOST, "--port", str(self.sensor_port), "--network", network),
        )

    def _processes(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        box = ("--box", str(self.box_file))
        yield STAGE, ("play", "--show", str(self.show), *box, "--alone")
        yield "control", ("control", *box)
        yield "keeper", ("keep", *box)
        yield "console", ("console", *box)
        yield "generator", ("generate", "--show", str(self.show), *box)
        yield "remote", ("remote", *box)
        yield "lights", ("lights", *box)
        yield "projector", ("project", *box, "--offscreen", _PICTURE)

    def _settings(self, ears: Ears) -> dict[str, Any]:
        receivers = [{"host": HOST, "port": port, "dialect": "joint"} for port in ears.guests]
        own = {"host": HOST, "port": ears.frames, "dialect": "ai-toolbox", "frame_message": True}
        lamps = {"universe": 1, "wire": "artnet", "host": HOST, "port": ears.lamps}
        return {
            "sensors": {"udp": {"host": HOST, "port": self.sensor_port}, "keys": str(self._keys)},
            "state": str(self.folder / "state"),
            "outputs": {"osc": [*receivers, own], "dmx": [lamps]},
            "control": {
                "host": HOST,
                "port": self.control_port,
                "heartbeat": [{"host": HOST, "port": ears.heartbeat}],
            },
            "console": {"host": HOST, "port": self.page_port},
            "timecode": {"send": [{"host": HOST, "port": ears.timecode}]},
            "runtime": str(self.runtime),
            "projector": {"rate": 30},
            "limits": {"late_ms": LATE_MS},
            "journal": {"folder": str(self.folder / "journal"), "minutes": JOURNAL_MINUTES},
        }


def sensors_of(show: Path) -> list[str]:
    """The names of the sensors that hold joints in this show; raises ValueError where there is none."""
    hands = _plain(show / "show.yaml").get("hands") or []
    names = list(dict.fromkeys(hand["sensor"] for hand in hands if hand.get("sensor")))
    if not names:
        raise ValueError(f"{show}: no sensor holds a joint in this show. Give one with sensors.")
    return names


def _with_lamps(show: Path, copy: Path) -> Path:
    """The same show with a small rig, where it has none: else there would be no lights to soak."""
    shutil.copytree(show, copy)
    config = _plain(copy / "show.yaml")
    if not (config.get("lights") or {}).get("fixtures"):
        lights = _rig(config["hands"][0]["joint"])
        (copy / "show.yaml").write_text(yaml.safe_dump({**config, "lights": lights}))
    return copy


def _rig(joint: str) -> dict[str, Any]:
    """A head that follows this joint, and a lamp that is on."""
    rules = [
        {"reads": "place", "joint": joint, "drives": "aim"},
        {"reads": "steady", "drives": "dimmer"},
    ]
    return {
        "fixtures": [
            {"name": "head", "profile": "moving-wash", "address": 1, "place": [1.5, 3.5, 1.0]},
            {"name": "par", "profile": "led-par", "address": 21, "place": [-2.0, 3.5, 0.0]},
        ],
        "mappings": [{"name": "warm", "rules": rules}],
    }


def _plain(path: Path) -> dict[str, Any]:
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    return values if isinstance(values, dict) else {}
