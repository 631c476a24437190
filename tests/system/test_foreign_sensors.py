"""The real box with programs in place of wearables: GyrOSC, SlimeVR and mocopi over real UDP."""

from __future__ import annotations

import contextlib
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.outputs.frame_reader import FrameReader
from appliance.pose import quaternion
from appliance.show_control.packet import datagram
from hw_sim.peers import HOST, free_ports
from tests.bundles import FIGURE, write_show
from tests.sensor.foreign.test_sources import mocopi_frame
from tests.system.box import playing
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime

SHOULDER, ELBOW, THIGH = (FIGURE.index(name) for name in ("lShldr", "lForeArm", "lThigh"))
TURN = 0.7  # radians to the left, about the vertical
HANDS: list[dict[str, object]] = [
    {"sensor": "phone-app", "joint": "lShldr"},
    {"sensor": "tracker", "joint": "lForeArm"},
    {"sensor": "suit", "joint": "lThigh"},
]


def gyrosc(radians: float) -> bytes:
    """Right-handed, z up."""
    return datagram(("/gyrosc/quat", math.cos(radians / 2), 0.0, 0.0, math.sin(radians / 2)))


def slimevr(radians: float) -> bytes:
    """Left-handed, y up: a turn to the left is negative."""
    turn = 0.0, math.sin(-radians / 2), 0.0, math.cos(radians / 2)
    return datagram(("/VMC/Ext/Bone/Pos", "LeftLowerArm", 0.0, 1.0, 0.0, *turn))


def mocopi(radians: float) -> bytes:
    """Right-handed, y up."""
    return mocopi_frame({"l_up_leg": (math.cos(radians / 2), 0.0, math.sin(radians / 2), 0.0)})


@contextlib.contextmanager
def sending(made: Callable[[float], bytes], port: int, angle: list[float]) -> Iterator[None]:
    """A program that sends 60 orientations a second; `angle` is turned meanwhile."""
    is_over = threading.Event()

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            while not is_over.wait(1 / 60):
                one.sendto(made(angle[0]), (HOST, port))

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    yield
    is_over.set()
    thread.join()


def test_programs_hold_joints_as_wearables_do(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show", hands=HANDS)
    ports = free_ports(3)
    foreign = [
        {"name": "phone-app", "from": "gyrosc", "port": ports[0]},
        {"name": "tracker", "from": "slimevr", "port": ports[1], "bone": "LeftLowerArm"},
        {"name": "suit", "from": "mocopi", "port": ports[2], "bone": "l_up_leg"},
    ]
    angle = [0.0]
    with (
        playing(show, tmp_path, settings={"sensors": {"foreign": foreign}}, names=()) as box,
        closing(FrameReader(box.runtime)) as reader,
    ):
        box.frames(1)

        def turns(joint: int, radians: float) -> bool:
            frame = reader.newest(time.monotonic())
            if frame is None:
                return False
            wanted = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), radians)
            return float(quaternion.angle_between(frame.puppets[0].pose[joint], wanted)) < 0.02

        with contextlib.ExitStack() as programs:
            for made, port in zip((gyrosc, slimevr, mocopi), ports, strict=True):
                programs.enter_context(sending(made, port, angle))
            for one in foreign:
                box.await_output(f"Sensor {one['name']}: neutral pose taken. Dance.")
            angle[0] = TURN
            for joint in (SHOULDER, ELBOW, THIGH):
                wait_until(lambda joint=joint: turns(joint, TURN), lambda: box.output)
            listed = box.listed_sensors()
            assert {name: one["way"] for name, one in listed.items()} == {
                "phone-app": "gyrosc",
                "tracker": "slimevr",
                "suit": "mocopi",
            }
        wait_until(lambda: turns(SHOULDER, 0.0), lambda: box.output)  # silent: the joint is given back
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            one.sendto(datagram(("/gyrosc/quat", 2.0, 0.0, 0.0, 0.0)), (HOST, ports[0]))
        box.await_output("Datagrams for phone-app at port")
        assert box.end() == 0
    assert "Traceback" not in box.output
