"""Two real boxes of a pair in a hall: networks of their own, a switch between, receivers of all outputs."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import random
import select
import signal
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import yaml

from appliance.pair.part import BoxPart, PartReader
from appliance.sensor import wire
from hw_sim import osc_receiver
from tests.system.namespace import Cable, Namespace
from tests.system.processes import BUNRAKU, Process, descendants, has_argument, run, wait_until

_PSN_FRAME = 18  # after two heads of chunks, the time and the version (PosiStageNet 2.03, section 3.2)
HALL, FIRST, SECOND = "10.77.0.9", "10.77.0.1", "10.77.0.2"
PAIR_PORT, OSC_PORT, CONTROL_PORT, SENSORS_PORT = 9760, 9004, 9002, 9750
KEY = "00112233445566778899aabbccddeeff"
DIRECT = {FIRST: "10.78.0.1", SECOND: "10.78.0.2"}
AHEAD_S = {FIRST: 3000.0, SECOND: 0.0}  # their monotonic clocks: the first one was switched on earlier
_KIND = 3  # where a packet of a wearable has its kind
_HELLO, _ASSIGNMENT, _CALL = (
    next(kind for kind, layout in wire.LAYOUTS.items() if layout.name == name)
    for name in ("Hello", "Assignment", "Call")
)


def other(address: str) -> str:
    return SECOND if address == FIRST else FIRST


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Relay:
    """The cable between the boxes, a process: loses datagrams, and holds them up. Times in seconds."""

    def __init__(self, network: Namespace) -> None:
        self._ways = multiprocessing.get_context("fork").Array("d", [0.0] * 4, lock=False)
        with network.entered():
            taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            taken.bind((HALL, PAIR_PORT))
        self._process = multiprocessing.get_context("fork").Process(
            target=self._run, args=(taken,), daemon=True
        )
        self._process.start()
        taken.close()

    def set(
        self, *, loss: float = 0.0, delay_s: float = 0.0, jitter_s: float = 0.0, cut: bool = False
    ) -> None:
        """From now on."""
        self._ways[:] = [loss, delay_s, jitter_s, float(cut)]

    def close(self) -> None:
        self._process.kill()
        self._process.join()

    def _run(self, taken: socket.socket) -> None:
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(80))  # a cable is never busy
        taken.setblocking(False)
        rng, number = random.Random(1), 0
        waiting: list[tuple[float, int, bytes, str]] = []
        while True:
            now = time.monotonic()
            wait_s = min([0.5, *(max(0.0, one[0] - now) for one in waiting)])
            select.select([taken], [], [], wait_s)
            with contextlib.suppress(OSError):
                while True:
                    data, (host, _) = taken.recvfrom(4096)
                    loss, delay_s, jitter_s, cut = self._ways
                    if cut or rng.random() < loss:
                        continue
                    number += 1
                    at = time.monotonic() + delay_s + jitter_s * rng.random()
                    waiting.append((at, number, data, SECOND if host == FIRST else FIRST))
            now = time.monotonic()
            due = sorted(one for one in waiting if one[0] <= now)
            waiting = [one for one in waiting if one[0] > now]
            for _, _, data, to in due:
                with contextlib.suppress(OSError):
                    taken.sendto(data, (to, PAIR_PORT))


class Seen:
    """What came on the wires, from whom: a thread that notes arrivals until it is closed."""

    def __init__(self, network: Namespace) -> None:
        self.osc: list[tuple[float, str, list[Any]]] = []  # arrival, box, arguments of the frame message
        self._bundles: list[tuple[float, str, bytes]] = []
        self.psn: list[tuple[float, str, int]] = []  # arrival, box, number of the frame
        self.sacn: list[tuple[float, str, int, bytes]] = []  # arrival, box, priority, levels
        self.artnet: list[tuple[float, str, bytes]] = []
        with network.entered():
            self._sockets = {
                "osc": _listening(OSC_PORT),
                "psn": _listening(56565, "236.10.10.10"),
                "sacn": _listening(5568, "239.255.0.1"),
                "artnet": _listening(6454),
            }
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        for one in self._sockets.values():
            one.close()

    def _run(self) -> None:
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), -19)  # what comes is noted in time
        names = {one.fileno(): name for name, one in self._sockets.items()}
        poll = select.epoll()
        for descriptor in names:
            poll.register(descriptor, select.EPOLLIN)
        while not self._ended.is_set():
            for descriptor, _ in poll.poll(0.05):
                name = names[descriptor]
                with contextlib.suppress(BlockingIOError):
                    while True:
                        data, ancillary, _, (host, _) = self._sockets[name].recvmsg(4096, 64)
                        seconds, nanoseconds = struct.unpack("@qq", ancillary[0][2])
                        self._note(name, seconds + 1e-9 * nanoseconds, host, data)
        poll.close()

    def _note(self, name: str, at: float, host: str, data: bytes) -> None:
        if name == "psn":
            if data[:2] == b"\x55\x67":  # data, not names: PSN_DATA_PACKET
                self.psn.append((at, host, data[_PSN_FRAME]))
        elif name == "sacn":
            self.sacn.append((at, host, data[108], data[126:]))
        elif name == "artnet":
            self.artnet.append((at, host, data[18:]))
        elif data.startswith(b"/bunraku/frame"):
            self.osc.append((at, host, _messages(data)[0][1]))
        else:
            self._bundles.append((at, host, data))

    def poses(self, since: float, until: float) -> list[tuple[float, str, str, list[float]]]:
        """Orientations of joints that came between two moments: arrival, box, address, quaternion."""
        bundles = [one for one in list(self._bundles) if since <= one[0] <= until]
        return [
            (at, host, address, arguments)
            for at, host, data in bundles
            for address, arguments in _messages(data)
            if address.endswith("/rot")
        ]

    def clear(self) -> None:
        """Forget what came, but for the last half second."""
        since = time.time() - 0.5
        for one in (self.osc, self._bundles, self.psn, self.sacn, self.artnet):
            del one[: sum(came[0] < since for came in list(one))]


def _messages(data: bytes) -> list[tuple[str, list[Any]]]:
    return [(address, arguments) for address, arguments in osc_receiver.decode(data)]


def _listening(port: int, group: str = "") -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, 33, 4 << 20)
    made.setsockopt(socket.SOL_SOCKET, 35, 1)  # SO_TIMESTAMPNS: the kernel says when it came
    made.bind(("", port))
    if group:
        made.setsockopt(
            socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + socket.inet_aton(HALL)
        )
    made.setblocking(False)
    return made


class PairedBox(Process):
    """One of the two."""

    def __init__(
        self, folder: Path, network: Namespace, address: str, show: Path, settings: dict[str, Any]
    ) -> None:
        self.folder, self.address, self.runtime = folder, address, folder / "runtime"
        folder.mkdir(exist_ok=True)
        (folder / "pair.key").write_text(KEY)
        (folder / "box.yaml").write_text(yaml.safe_dump(settings))
        command = [*BUNRAKU, "play", "--show", str(show), "--box", str(folder / "box.yaml")]
        super().__init__(folder / "words.txt", self._inside(network, "nice", "-n", "-15", *command))
        self._network = network

    def _inside(self, network: Namespace, *command: str) -> list[str]:
        return network.command("unshare", "--time", "--monotonic", f"{AHEAD_S[self.address]:.0f}", *command)

    def ask(self, *command: str) -> tuple[int, str]:
        """A command of bunraku at this box: its status and what it prints."""
        done = run(self._inside(self._network, *BUNRAKU, *command, "--box", str(self.folder / "box.yaml")))
        return done.returncode, done.stdout

    def start(self) -> None:
        self._spoke = len(self.output) if self.output_file.exists() else 0
        super().start()

    @property
    def part(self) -> BoxPart | None:
        """Its stage's part; None where that is a second old: the stage is away."""
        with contextlib.closing(PartReader(self.runtime)) as reader:
            part = reader.read()
        now = time.monotonic() + AHEAD_S[self.address]
        return part if part is not None and now - part.written < 1.0 else None

    @property
    def is_lit(self) -> bool:
        """Whether its lights have come since it was switched on."""
        return "Lights:" in self.output[self._spoke :]

    def prefer_lights(self) -> None:
        """As on a machine where nothing but the box runs: the lights need not wait for other programs."""
        for pid in descendants(self.process.pid):
            if has_argument(pid, "lights"):
                with contextlib.suppress(PermissionError):
                    os.sched_setscheduler(pid, os.SCHED_RR, os.sched_param(1))

    def waited_ms(self) -> dict[str, float]:
        """For how long the kernel has let its stage and its lights wait for a processor."""
        stage = self.process.pid
        lights = [one for one in descendants(stage) if has_argument(one, "lights")]
        found = {}
        for name, pid in (("stage", stage), *(("lights", one) for one in lights)):
            with contextlib.suppress(OSError):
                waited_ns = Path(f"/proc/{pid}/task/{pid}/schedstat").read_text().split()[1]
                found[name] = int(waited_ns) / 1e6
        return found

    def signal(self, number: int) -> None:
        """To all its processes: power, or a machine that hangs."""
        everyone = [self.process.pid, *descendants(self.process.pid)]
        with before_others():
            for pid in everyone:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)

    def cut_power(self) -> None:
        """All processes at once."""
        self.signal(signal.SIGKILL)
        self.process.wait()


@contextlib.contextmanager
def before_others() -> Iterator[None]:
    """No other program runs between two steps of this thread."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(85))
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class HallRadio:
    """A wearable's radio: it greets both boxes, and speaks to the one that answered or called last."""

    is_up = True

    def __init__(self, network: Namespace) -> None:
        with network.entered():
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._everyone = [(FIRST, SENSORS_PORT), (SECOND, SENSORS_PORT)]
        self._to = self._everyone

    @property
    def descriptor(self) -> int:
        return self._socket.fileno()

    def send_packet(self, data: bytes) -> bool:
        for address in self._everyone if data[_KIND] == _HELLO else self._to:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, address)
        return True

    def receive_packet(self) -> bytes | None:
        try:
            data, sender = self._socket.recvfrom(2 * wire.LARGEST)
        except OSError:
            return None
        if data[_KIND] in (_ASSIGNMENT, _CALL):
            self._to = [sender]
        return data

    def close(self) -> None:
        self._socket.close()


class Hall:
    """A context: two boxes on one switch. first, second: None until they are switched on."""

    def __init__(
        self,
        folder: Path,
        show: Path,
        *,
        relayed: bool = True,
        paired: bool = True,
        locked: bool = False,
        direct: bool = False,
        **more: Any,
    ) -> None:
        """more: of the box file. direct: a cable between the boxes beside the switch. Without `paired` the
        boxes know nothing of each other; locked: they are in step, and both speak.
        """
        self.folder, self.show, self._relayed, self._more = folder, show, relayed, more
        self._paired, self._locked, self._direct = paired, locked, direct
        self._opened = ExitStack()
        self.boxes: dict[str, PairedBox] = {}

    def __enter__(self) -> Self:
        opened = self._opened
        self.hall = opened.enter_context(Namespace("hall"))
        self.networks = {
            FIRST: opened.enter_context(Namespace("one")),
            SECOND: opened.enter_context(Namespace("two")),
        }
        name = self.hall.name
        _ip("-n", name, "link", "add", "br0", "type", "bridge")
        _ip("-n", name, "address", "add", f"{HALL}/24", "dev", "br0")
        _ip("-n", name, "link", "set", "br0", "up")
        self.ends: dict[str, str] = {}
        for number, (address, network) in enumerate(self.networks.items()):
            end = f"bk{os.getpid() % 100000}h{number}"
            _ip(
                "link",
                "add",
                end,
                "netns",
                name,
                "type",
                "veth",
                "peer",
                "name",
                "eth0",
                "netns",
                network.name,
            )
            _ip("-n", name, "link", "set", end, "master", "br0", "up")
            _ip("-n", network.name, "address", "add", f"{address}/24", "dev", "eth0")
            _ip("-n", network.name, "link", "set", "eth0", "up")
            _ip("-n", network.name, "route", "add", "default", "via", HALL)
            self.ends[address] = end
        if self._direct:
            one, two = self.networks.values()
            self.pull_direct = Cable(one, f"{DIRECT[FIRST]}/24", two, f"{DIRECT[SECOND]}/24").pull_out
        self.relay = Relay(self.hall)
        opened.callback(self.relay.close)
        self.seen = Seen(self.hall)
        opened.callback(self.seen.close)
        return self

    def __exit__(self, *_: object) -> None:
        for box in self.boxes.values():
            if box.process.poll() is None:
                box.signal(signal.SIGCONT)
                box.cut_power()
        self._opened.close()

    def switch_on(self, address: str) -> PairedBox:
        """A box with power: a new process, what it kept is there."""
        is_first = address == FIRST
        peer = HALL if self._relayed else SECOND if is_first else FIRST
        settings: dict[str, Any] = {
            "sensors": {
                "udp": {"host": "0.0.0.0", "port": SENSORS_PORT},
                "keys": str(self.folder / "sensors.keys"),
            },
            "outputs": {
                "osc": [{"host": HALL, "port": OSC_PORT, "frame_message": True, "dialect": "joint"}],
                "posistagenet": [{"interface": address}],
            },
            "control": {"host": "127.0.0.1", "port": CONTROL_PORT},
            "console": None,
            "runtime": "runtime",
            "resume": "never",
            "realtime": {"priority": 75},  # above a box of another test
            "pair": {
                "role": "first" if is_first else "second",
                "peer": [peer, *([DIRECT[other(address)]] if self._direct else ())],
                "host": "0.0.0.0",
                "port": PAIR_PORT,
                "secret": "pair.key",
            },
        }
        if self._locked or not self._paired:
            del settings["pair"]
        if self._locked:
            end = {"host": peer, "port": PAIR_PORT}
            role = {"followers": [end]} if is_first else {"leader": peer, "port": PAIR_PORT}
            settings["locked"] = {"host": "0.0.0.0", "secret": "pair.key"} | role
        for section, values in self._more.items():
            settings[section] = {**settings.get(section, {}), **values}
        for one in settings["outputs"].get("dmx", []):
            one["interface"] = address
        folder = self.folder / ("first" if is_first else "second")
        box = self.boxes[address] = PairedBox(folder, self.networks[address], address, self.show, settings)
        return box

    def pull_cable(self, address: str) -> None:
        """Of the switch, at this box."""
        _ip("-n", self.hall.name, "link", "set", self.ends[address], "down")

    def forget(self, address: str) -> None:
        """As after a minute without an answer: the network has to ask for this box's card once more."""
        _ip("-n", self.hall.name, "neigh", "flush", "to", address, "dev", "br0")

    def plug_cable(self, address: str) -> None:
        """Back in."""
        _ip("-n", self.hall.name, "link", "set", self.ends[address], "up")

    def await_pair(self) -> None:
        """Until one leads, and the other one could take over."""

        def are_ready() -> bool:
            parts = [box.part for box in self.boxes.values()]
            lead = [part.leads for part in parts if part is not None and (part.leads or part.is_ready)]
            return len(lead) == len(parts) and sum(lead) == 1

        wait_until(are_ready, lambda: "\n".join(box.output for box in self.boxes.values()))

    def await_whole(self) -> None:
        """Until they are a pair, and the lights of both have come."""
        self.await_pair()
        wait_until(lambda: all(box.is_lit for box in self.boxes.values()), "the lights never came")
        for box in self.boxes.values():
            box.prefer_lights()

    @property
    def epoch(self) -> int:
        """How often the lead has changed, as the box has it that leads."""
        return next(part.epoch for box in self.boxes.values() if (part := box.part) and part.leads)

    @property
    def leader(self) -> str:
        """Address of the box that leads."""
        return next(address for address, box in self.boxes.items() if (part := box.part) and part.leads)
