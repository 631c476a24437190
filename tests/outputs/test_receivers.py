"""OSC receivers over real sockets: each gets its dialect, and nobody's absence disturbs the others."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.outputs.datagram_sender import LONGEST_PAUSE_S
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.vmc import Vmc
from appliance.outputs.receivers import OscOutputs
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from hw_sim.osc_receiver import OscReceiver, Received
from tests.outputs.conftest import fill

LOOPBACK = "127.0.0.1"
PATIENCE_S = 30.0
FRAME_RATE_HZ = 50


@pytest.fixture
def peer() -> Iterator[OscReceiver]:
    with OscReceiver(LOOPBACK) as listening:
        yield listening


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOOPBACK, 0))
        return int(taken.getsockname()[1])


def take(peer: OscReceiver, count: int) -> list[Received]:
    """The next `count` messages."""
    messages: list[Received] = []
    while len(messages) < count:
        new = peer.poll(timeout=5.0)
        assert new, f"only {len(messages)} of {count} messages came"
        messages += new
    return messages


def test_each_receiver_gets_its_dialect_with_the_frame_message_first(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    with OscReceiver(LOOPBACK) as toolbox, OscReceiver(LOOPBACK) as channels, OscReceiver(LOOPBACK) as avatar:
        outputs = OscOutputs(
            [
                OscConfig(port=toolbox.port, dialect="ai-toolbox", frame_message=True),
                OscConfig(port=channels.port, dialect="joint", frame_message=False),
                OscConfig(port=avatar.port, dialect="vmc", frame_message=True),
            ],
            skeleton,
        )
        outputs.send_frame(frame)
        first = take(toolbox, 4)
        assert [address for _, address, _ in first] == [
            "/bunraku/frame",
            "/mocap/0/joint/rot_local",
            "/mocap/0/joint/pos_world",
            "/mocap/0/joint/rot_world",
        ]
        np.testing.assert_array_equal(np.array(first[1][2], np.float32), frame.pose.ravel())
        assert take(channels, 2 * len(skeleton))[0][1] == "/dancer/hip/rot"
        assert [address for _, address, _ in take(avatar, 4)][:2] == ["/bunraku/frame", "/VMC/Ext/OK"]
        assert [receiver.dropped for receiver in outputs.receivers] == [0, 0, 0]
        assert outputs.receivers[0].sent == 4
        outputs.close()


def test_two_receivers_of_one_dialect_get_the_same_bytes(skeleton: Skeleton, frame: JointFrame) -> None:
    with OscReceiver(LOOPBACK) as one, OscReceiver(LOOPBACK) as two:
        outputs = OscOutputs([OscConfig(port=one.port), OscConfig(port=two.port)], skeleton)
        outputs.send_frame(frame)
        assert [m[1:] for m in take(one, 3)] == [m[1:] for m in take(two, 3)]
        outputs.close()


def test_a_receiver_that_is_not_there_is_counted_and_disturbs_nobody(
    skeleton: Skeleton, frame: JointFrame, peer: OscReceiver
) -> None:
    outputs = OscOutputs([OscConfig(port=free_port()), OscConfig(port=peer.port)], skeleton)
    for seed in range(20):
        outputs.send_frame(fill(frame, skeleton, seed))
    absent, present = outputs.receivers
    assert len(take(peer, 3 * 20)) == 3 * 20
    assert (present.sent, present.dropped, present.last_error) == (60, 0, "")
    assert absent.sent + absent.dropped == 60 and absent.dropped > 50
    assert absent.last_error == "no program listens on that port"
    outputs.close()


def test_a_receiver_that_comes_back_is_served_within_a_second(skeleton: Skeleton, frame: JointFrame) -> None:
    port = free_port()
    outputs = OscOutputs([OscConfig(port=port)], skeleton)
    for seed in range(500):  # long enough for the longest pause
        outputs.send_frame(fill(frame, skeleton, seed))
    with OscReceiver(LOOPBACK, port) as back:
        for seed in range(500, 500 + round(LONGEST_PAUSE_S * FRAME_RATE_HZ) + 1):
            outputs.send_frame(fill(frame, skeleton, seed))
        assert take(back, 3)[0][1] == "/mocap/0/joint/rot_local"
    outputs.close()


def test_tries_become_rarer_up_to_once_a_second(skeleton: Skeleton, frame: JointFrame) -> None:
    outputs = OscOutputs([OscConfig(port=free_port())], skeleton)
    tries = []
    for number in range(400):
        sent = outputs.receivers[0].sent
        outputs.send_frame(fill(frame, skeleton, number))
        if outputs.receivers[0].sent > sent:
            tries.append(number)
    pauses = np.diff(tries)
    assert pauses[:4] == pytest.approx([5, 10, 20, 40], abs=1)
    assert pauses[4:] == pytest.approx(LONGEST_PAUSE_S * FRAME_RATE_HZ, abs=1)
    outputs.close()


def test_addresses_that_cannot_be_reached_never_raise(
    skeleton: Skeleton, frame: JointFrame, peer: OscReceiver
) -> None:
    configs = [OscConfig(host=host, port=9004) for host in ("240.0.0.1", "0.0.0.1")]
    outputs = OscOutputs([*configs, OscConfig(port=peer.port)], skeleton)
    for _ in range(3):
        outputs.send_frame(frame)
    assert len(take(peer, 9)) == 9
    for receiver in outputs.receivers[:-1]:
        assert receiver.sent + receiver.dropped == 9
        assert bool(receiver.dropped) == bool(receiver.last_error)
    outputs.close()


def test_messages_too_long_for_a_datagram_are_dropped_with_the_reason(peer: OscReceiver) -> None:
    joints = 5000
    skeleton = Skeleton(tuple(map(str, range(joints))), tuple(range(-1, joints - 1)), np.zeros((joints, 3)))
    outputs = OscOutputs([OscConfig(port=peer.port)], skeleton)
    outputs.send_frame(JointFrame(joints))
    receiver = outputs.receivers[0]
    assert (receiver.sent, receiver.dropped) == (0, 3)
    assert receiver.last_error == "the message is too long for a datagram"
    outputs.close()


IN_A_NETWORK_OF_ITS_OWN = """
import socket
import subprocess
import numpy as np
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.vmc import Vmc
from appliance.outputs.receivers import OscOutputs
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from hw_sim.osc_receiver import OscReceiver
def ip(*commands):
    for command in commands:
        subprocess.run(["ip", *command.split()], check=True)
ip("link set lo up")
skeleton = Skeleton(tuple(map(str, range(43))), tuple(range(-1, 42)), np.zeros((43, 3)))
frame = JointFrame(43)
"""
TWO_DARK_MACHINES = """
ip("link add v0 type veth peer name v1", "addr add 10.99.0.1/24 dev v0", "link set v0 up", "link set v1 up")
with OscReceiver("127.0.0.1") as peer:
    dark = [OscConfig(host=f"10.99.0.{n}") for n in (2, 3)]
    outputs = OscOutputs([*dark, OscConfig(port=peer.port)], skeleton)
    arrived = 0
    for _ in range(400):
        outputs.send_frame(frame)
        arrived += len(peer.poll())
    arrived += len(peer.poll(0.2))
    print(arrived, outputs.receivers[-1].dropped)
    shared = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    shared.setblocking(False)
    refused = 0
    for host in 400 * ["10.99.0.2", "10.99.0.3"]:
        try:
            shared.sendto(bytes(900), (host, 9004))
        except BlockingIOError:
            refused += 1
    print("a shared socket is full:", refused > 0)
"""
CABLE_PLUGGED_IN_LATER = """
outputs = OscOutputs([OscConfig(host="10.99.0.2")], skeleton)
for frame.frame_time in np.arange(0.0, 4.0, 0.02):
    outputs.send_frame(frame)
print(outputs.receivers[0].sent, outputs.receivers[0].last_error)
ip("addr add 10.99.0.2/24 dev lo")
with OscReceiver("10.99.0.2", 9004) as peer:
    for frame.frame_time in np.arange(4.0, 5.02, 0.02):
        outputs.send_frame(frame)
    print(len(peer.poll()) > 0)
"""


def run_in_network(script: str) -> list[str]:
    """Lines that the script prints on a machine with no network but what it sets up itself."""
    namespace = ["unshare", "--net", "--map-root-user"]
    if subprocess.run([*namespace, "ip", "link", "set", "lo", "up"], capture_output=True).returncode:
        pytest.skip("this machine does not allow network namespaces")
    command = [*namespace, sys.executable, "-c", IN_A_NETWORK_OF_ITS_OWN + script]
    root = Path(__file__).resolve().parents[2]
    run = subprocess.run(command, capture_output=True, text=True, cwd=root, timeout=60)
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()


def test_machines_that_are_switched_off_do_not_fill_the_others_buffer() -> None:
    """Two addresses on a cable that nobody answers; a shared socket lost 510 of 600 datagrams like this."""
    assert run_in_network(TWO_DARK_MACHINES) == ["1200 0", "a shared socket is full: True"]


def test_a_network_that_comes_up_after_the_box_is_used() -> None:
    assert run_in_network(CABLE_PLUGGED_IN_LATER) == ["0 no network leads there", "True"]


@pytest.fixture
def oscdump() -> Iterator[tuple[int, subprocess.Popen[str]]]:
    program = shutil.which("oscdump")
    if not program:
        pytest.fail("the program 'oscdump' is missing: install the Debian package liblo-tools")
    port = free_port()
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
        frame = JointFrame(len(skeleton))
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


def test_each_puppet_goes_out_under_its_own_addresses(skeleton: Skeleton) -> None:
    frames = [fill(JointFrame(len(skeleton)), skeleton, seed) for seed in (7, 8, 9)]
    wanted: list[dict[str, Any]] = [
        {"messages": ["rot_local"], "frame_message": True},
        {"messages": ["rot_local"], "prefix": "/mocap/joint"},  # it has room for one
        {"dialect": "features", "prefix": "/mocap/3/joint"},
        {"dialect": "joint"},
        {"dialect": "vmc"},
        {"messages": ["rot_local"], "puppet": 2},
    ]
    with ExitStack() as opened:
        peers = [opened.enter_context(OscReceiver(LOOPBACK)) for _ in wanted]
        configs = [OscConfig(port=peer.port, **one) for peer, one in zip(peers, wanted, strict=True)]
        outputs = OscOutputs(configs, skeleton, puppets=3)
        outputs.send_frame(*frames)
        toolbox = take(peers[0], 4)
        assert [said[1] for said in toolbox[:1]] == ["/bunraku/frame"]
        for number, (said, frame) in enumerate(zip(toolbox[1:], frames, strict=True)):
            assert said[1] == f"/mocap/{number}/joint/rot_local"
            np.testing.assert_array_equal(np.array(said[2], np.float32), frame.pose.ravel())
        assert [said[1] for said in take(peers[1], 1)] == ["/mocap/joint/rot_local"]
        features = [said[1] for said in take(peers[2], 30)]
        assert features[::10] == [f"/mocap/{number}/joint/velocity" for number in (3, 4, 5)]
        joints = take(peers[3], 3 * 2 * len(skeleton))
        hips = {said[1]: said[2] for said in joints if said[1].endswith("/hip/rot")}
        for dancer, frame in zip(("", "/1", "/2"), frames, strict=True):
            said = hips[f"/dancer{dancer}/hip/rot"]
            np.testing.assert_array_equal(np.array(said, np.float32), frame.pose[0])
        last = take(peers[5], 1)
        assert last[0][1] == "/mocap/0/joint/rot_local"
        np.testing.assert_array_equal(np.array(last[0][2], np.float32), frames[2].pose.ravel())
        assert outputs.receivers[1].sent == 1 and outputs.receivers[4].sent == len(
            Vmc(skeleton).encode(frames[0])
        )
        outputs.close()
