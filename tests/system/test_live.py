"""The real box with a live dancer: another program's motion capture in the phrase's place, over real UDP."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from pythonosc.udp_client import SimpleUDPClient

from appliance.outputs.frame_reader import FrameReader
from appliance.pose import quaternion
from appliance.pose.point_layouts import LAYOUTS
from hw_sim.peers import HOST
from tests.bundles import FIGURE, write_show
from tests.show_control.doubles import PATIENCE_S, Asker
from tests.system.box import Box, playing
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime

ELBOW = FIGURE.index("lForeArm")  # it rests in the phrase


@pytest.fixture
def show(tmp_path: Path) -> Path:
    return write_show(tmp_path / "show", hands=[], motion={"live": True})


@contextlib.contextmanager
def streaming(control: int, radians: float, rate: float = 60.0) -> Iterator[None]:
    """A program that sends a dancer with a bent elbow, as the AI-Toolbox programs do."""
    pose = np.tile(quaternion.IDENTITY.astype(float), (len(FIGURE), 1))
    pose[ELBOW] = quaternion.from_axis_angle([0.0, 0.0, 1.0], radians)
    with sending(control, "/mocap/0/joint/rot_local", pose.ravel().tolist(), rate):
        yield


def points_of(radians: float) -> list[float]:
    """COCO's 17 points of a person with spread arms and a bent left elbow; its face points to +Z."""
    places = {"shoulder": (0.2, 1.4, 0.0), "elbow": (0.5, 1.4, 0.0), "wrist": (0.8, 1.4, 0.0)}
    places |= {"hip": (0.1, 0.9, 0.0), "knee": (0.1, 0.5, 0.02), "ankle": (0.1, 0.1, 0.0)}
    places |= {"eye": (0.03, 1.65, 0.1), "ear": (0.07, 1.63, 0.0)}
    bent = (0.5 + 0.3 * np.cos(radians), 1.4 + 0.3 * np.sin(radians), 0.0)
    points = {"nose": (0.0, 1.6, 0.12), **{f"left {part}": place for part, place in places.items()}}
    points |= {f"right {part}": (-x, y, z) for part, (x, y, z) in places.items()}
    points["left wrist"] = bent
    return [float(number) for part in LAYOUTS["coco"].parts for number in points[part]]


@contextlib.contextmanager
def sending(control: int, address: str, numbers: list[float], rate: float = 30.0) -> Iterator[None]:
    client, is_over = SimpleUDPClient(HOST, control), threading.Event()

    def send() -> None:
        while not is_over.wait(1 / rate):
            client.send_message(address, numbers)

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    yield
    is_over.set()
    thread.join()


def await_elbow(box: Box, reader: FrameReader, radians: float) -> None:
    """Wait until the elbow that leaves the box has this angle."""

    def has_it() -> bool:
        frame = reader.newest(time.monotonic())
        if frame is None:
            return False
        turned = float(quaternion.angle_between(frame.puppets[0].pose[ELBOW], quaternion.IDENTITY))
        return abs(turned - radians) < 0.01

    wait_until(has_it, lambda: box.output)


def has_begun(reader: FrameReader, seen: int) -> bool:
    """Whether a stage after that of this generation dances."""
    return reader.newest(time.monotonic()) is not None and reader.generation > seen


def test_a_live_dancer_comes_falls_silent_comes_back_and_goes(show: Path, tmp_path: Path) -> None:
    with (
        playing(show, tmp_path) as box,
        closing(Asker(box.control)) as desk,
        closing(FrameReader(box.runtime)) as reader,
    ):
        box.frames(1)
        assert desk.order("/phrase", "live", 0.2)[2] == 1
        await_elbow(box, reader, 0.0)
        with streaming(box.control, 0.8):
            await_elbow(box, reader, 0.8)
        await_elbow(box, reader, 0.0)  # silent: the phrase plays on
        box.await_output("No live dancer is heard: the phrase plays on")
        with streaming(box.control, 0.4):
            await_elbow(box, reader, 0.4)
            box.await_output("The live dancer takes the phrase's place")
            seen = reader.generation
            box.kill_and_restart()
            wait_until(lambda: has_begun(reader, seen), lambda: box.output)
            await_elbow(box, reader, 0.4)  # the stage starts again with its guest
            assert desk.order("/phrase", "main", 0.2)[2] == 1
            await_elbow(box, reader, 0.0)
        assert box.end() == 0
    assert "Traceback" not in box.output


def test_a_camera_programs_points_move_the_figure(show: Path, tmp_path: Path) -> None:
    with (
        playing(show, tmp_path) as box,
        closing(Asker(box.control)) as desk,
        closing(FrameReader(box.runtime)) as reader,
    ):
        box.frames(1)
        with sending(box.control, "/mocap/0/joint/pos_world", points_of(0.8)):
            wait_until(lambda: "COCO's 17 points" in desk.status().live, lambda: box.output)
            assert desk.order("/phrase", "live", 0.2)[2] == 1
            await_elbow(box, reader, 0.8)
        await_elbow(box, reader, 0.0)  # silent: the phrase plays on
        assert box.end() == 0
    assert "Traceback" not in box.output


def lost_at(port: int) -> int:
    """How many datagrams the kernel threw away at a port, whose buffer is full where no processor is free."""
    lines = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return sum(int(fields[-1]) for fields in lines if fields[1].endswith(f":{port:04X}"))


def answer_to_ping(desk: Asker, port: int) -> str:
    """What a ping is answered with; asked again only after the kernel itself threw datagrams away."""
    ends_at = time.monotonic() + PATIENCE_S
    while True:
        lost = lost_at(port)
        desk.tell("/ping")
        heard = desk.hear(1.0)
        if heard is None and lost_at(port) == lost:
            heard = desk.hear()
        if heard is not None:
            return str(heard[0])
        assert lost_at(port) > lost, "a ping that arrived was not answered"
        assert time.monotonic() < ends_at, "no ping was answered"


def test_a_flood_of_poses_costs_no_frame(show: Path, tmp_path: Path) -> None:
    """Two thousand a second: the newest one counts, nothing queues up."""
    with playing(show, tmp_path) as box, closing(Asker(box.control)) as desk:
        box.frames(1)
        assert desk.order("/phrase", "live", 0.0)[2] == 1
        with streaming(box.control, 0.5, rate=2000.0):
            frames = box.frames(100)
            begun = time.monotonic()
            assert answer_to_ping(desk, box.control).endswith("pong")
        assert time.monotonic() - begun < 10.0
        numbers = [frame[0] for frame in frames]
        assert numbers == sorted(set(numbers))
        assert box.end() == 0
