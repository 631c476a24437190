"""A program of others, oscdump, reads every message that goes out, in each dialect."""

from __future__ import annotations

import os
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.outputs.receivers import OscOutputs
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from hw_sim.osc_receiver import OscReceiver, Received
from hw_sim.peers import free_ports
from tests.outputs.conftest import fill
from tests.outputs.osc_peers import LOOPBACK
from tests.outputs.small_stage import one_puppet

PATIENCE_S = 60.0


@pytest.fixture
def oscdump() -> Iterator[tuple[int, subprocess.Popen[str]]]:
    program = shutil.which("oscdump")
    if not program:
        pytest.fail("the program 'oscdump' is missing: install the Debian package liblo-tools")
    port = free_ports(1)[0]
    process = subprocess.Popen([program, "-L", str(port)], stdout=subprocess.PIPE, text=True)
    gives_up = threading.Timer(PATIENCE_S, process.kill)  # so that no reading of its lines lasts for ever
    gives_up.start()
    try:
        while not listens(port):
            assert process.poll() is None, "oscdump ended, or does not listen"
            os.sched_yield()
        yield port, process
    finally:
        gives_up.cancel()
        process.kill()
        process.communicate()


def listens(port: int) -> bool:
    """Whether some UDP socket is bound to the port."""
    tables = "".join(Path(table).read_text() for table in ("/proc/net/udp", "/proc/net/udp6"))
    return f":{port:04X} " in tables


@pytest.mark.parametrize("dialect", ["ai-toolbox", "joint", "vmc"])
def test_oscdump_reads_every_message(
    skeleton: Skeleton, oscdump: tuple[int, subprocess.Popen[str]], dialect: str
) -> None:
    port, process = oscdump
    outputs = OscOutputs(
        [OscConfig.model_validate({"port": port, "dialect": dialect, "frame_message": True})], skeleton
    )
    with OscReceiver(LOOPBACK) as ours:
        twin = OscOutputs(
            [OscConfig.model_validate({"port": ours.port, "dialect": dialect, "frame_message": True})],
            skeleton,
        )
        frame = one_puppet(len(skeleton))
        expected: list[Received] = []
        dumped: list[list[str]] = []
        assert process.stdout is not None
        for seed in range(10):
            outputs.send_frame(fill(frame, skeleton, seed))
            twin.send_frame(frame)
            expected += ours.poll(timeout=5.0)
            while len(dumped) < len(expected):
                line = process.stdout.readline()
                assert line, "oscdump hears too little"
                dumped.append(line.split()[1:])
        twin.close()
    outputs.close()
    assert outputs.receivers[0].dropped == 0
    assert len(expected) >= 10 * 4
    for (_, address, arguments), (dumped_address, _, *dumped_arguments) in zip(expected, dumped, strict=True):
        assert dumped_address == address
        for ours_value, dumped_value in zip(arguments, dumped_arguments, strict=True):
            if isinstance(ours_value, float):
                assert float(dumped_value) == pytest.approx(ours_value, abs=1e-6)
            else:
                assert dumped_value.strip('"') == str(ours_value)
