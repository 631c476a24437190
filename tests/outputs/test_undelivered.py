"""OSC messages that do not arrive: counted with the reason, tried again, and nobody else is disturbed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from appliance.outputs.datagram_sender import LONGEST_PAUSE_S
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.receivers import OscOutputs
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import free_ports
from tests.outputs.conftest import fill
from tests.outputs.osc_peers import LOOPBACK, take
from tests.outputs.small_stage import one_puppet

FRAME_RATE_HZ = 50
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
from tests.outputs.small_stage import one_puppet
def ip(*commands):
    for command in commands:
        subprocess.run(["ip", *command.split()], check=True)
ip("link set lo up")
skeleton = Skeleton(tuple(map(str, range(43))), tuple(range(-1, 42)), np.zeros((43, 3)))
frame = one_puppet(43)
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


@pytest.fixture
def peer() -> Iterator[OscReceiver]:
    with OscReceiver(LOOPBACK) as listening:
        yield listening


def test_a_receiver_that_is_not_there_is_counted_and_disturbs_nobody(
    skeleton: Skeleton, frame: JointFrame, peer: OscReceiver
) -> None:
    outputs = OscOutputs([OscConfig(port=free_ports(1)[0]), OscConfig(port=peer.port)], skeleton)
    for seed in range(20):
        outputs.send_frame(fill(frame, skeleton, seed))
    absent, present = outputs.receivers
    assert len(take(peer, 3 * 20)) == 3 * 20
    assert (present.sent, present.dropped, present.last_error) == (60, 0, "")
    assert absent.sent + absent.dropped == 60 and absent.dropped > 50
    assert absent.last_error == "no program listens on that port"
    outputs.close()


def test_a_receiver_that_comes_back_is_served_within_a_second(skeleton: Skeleton, frame: JointFrame) -> None:
    port = free_ports(1)[0]
    outputs = OscOutputs([OscConfig(port=port)], skeleton)
    for seed in range(500):  # long enough for the longest pause
        outputs.send_frame(fill(frame, skeleton, seed))
    with OscReceiver(LOOPBACK, port) as back:
        for seed in range(500, 500 + round(LONGEST_PAUSE_S * FRAME_RATE_HZ) + 1):
            outputs.send_frame(fill(frame, skeleton, seed))
        assert take(back, 3)[0][1] == "/mocap/0/joint/rot_local"
    outputs.close()


def test_tries_become_rarer_up_to_once_a_second(skeleton: Skeleton, frame: JointFrame) -> None:
    outputs = OscOutputs([OscConfig(port=free_ports(1)[0])], skeleton)
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
    outputs.send_frame(one_puppet(joints))
    receiver = outputs.receivers[0]
    assert (receiver.sent, receiver.dropped) == (0, 3)
    assert receiver.last_error == "the message is too long for a datagram"
    outputs.close()


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
