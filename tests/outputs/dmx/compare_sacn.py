"""The sacn library's sender beside the box's own: `python -m tests.outputs.dmx.compare_sacn`, as root.

Two network namespaces, a cable between them, no gateway: processor time, and a network that goes away.
"""

from __future__ import annotations

import logging
import subprocess
import threading
import time
from collections.abc import Callable

import sacn

from appliance.outputs.dmx.open_wire import open_universes
from hw_sim.dmx.sacn import Data, Discovery
from hw_sim.dmx.sacn_node import SacnReceiver
from tests.outputs.dmx.conftest import config, universe
from tests.system.namespace import Cable, Namespace

RATE_HZ, DESK = 40, "10.77.9.2"
Send = Callable[[bytes], object]


def library(discovery: bool) -> tuple[Send, Callable[[], object]]:
    sender = sacn.sACNsender(source_name="box", fps=RATE_HZ, universeDiscovery=discovery)
    sender.activate_output(1)
    sender[1].destination = DESK
    sender.start()

    def close() -> None:
        sender.deactivate_output(1)
        sender.stop()

    return lambda levels: setattr(sender[1], "dmx_data", tuple(levels)), close


def own() -> tuple[Send, Callable[[], object]]:
    (one,) = open_universes([config("sacn", host=DESK)])
    return lambda levels: one.offer(levels, time.monotonic()), lambda: one.close(time.monotonic())


def dance(send: Send, seconds: int) -> float:
    """Processor time of one universe, ms."""
    universes = [universe(tick) for tick in range(seconds * RATE_HZ)]
    began = time.process_time()
    for levels in universes:
        send(levels)
        time.sleep(1 / RATE_HZ)
    return 1000 * (time.process_time() - began) / len(universes)


def heard(receiver: SacnReceiver) -> str:
    packets = [packet for _, packet in receiver.poll(1.0)]
    data = [packet for packet in packets if isinstance(packet, Data)]
    lists = sum(isinstance(packet, Discovery) for packet in packets)
    return f"{len(data)} universes, {sum(one.terminated for one in data)} of them terminations, {lists} lists"


def main() -> None:
    logging.getLogger("sacn").setLevel(logging.CRITICAL)
    threading.excepthook = lambda died: print(f"    its thread died: {died.exc_value}")
    with Namespace("box") as box, Namespace("desk") as desk:
        Cable(box, "10.77.9.1/24", desk, f"{DESK}/24")
        listed = subprocess.run(
            ["ip", "-n", box.name, "-br", "link"], capture_output=True, text=True, check=True
        )
        cable = next(line.split("@")[0] for line in listed.stdout.splitlines() if "@" in line)
        for name, make in (
            ("the box's own", own),
            ("the library, without discovery", lambda: library(False)),
            ("the library", lambda: library(True)),
        ):
            with desk.entered():
                receiver = SacnReceiver((64214,), interface=DESK)
            with receiver, box.entered():
                before = threading.active_count()
                send, close = make()
                print(f"{name}: {threading.active_count() - before} threads")
                print(f"    2 s at {RATE_HZ} Hz, {dance(send, 2):.2f} ms a universe: {heard(receiver)}")
                for state in ("down", "up"):
                    subprocess.run(["ip", "-n", box.name, "link", "set", cable, state], check=True)
                    dance(send, 2)
                print(f"    network away for 2 s, back for 2 s: {heard(receiver)}")
                close()
                print(f"    closed: {heard(receiver)}")


if __name__ == "__main__":
    main()
