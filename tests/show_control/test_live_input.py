"""A live dancer's poses come through the control port, checked, and the newest one is there for the stage."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pythonosc.udp_client import SimpleUDPClient

from appliance.box.live_pose import LivePose, LivePoseReader
from appliance.levers.sources import LIVE
from tests.show_control.doubles import FIGURE, HOST, Asker, ControlInThread, StageDouble, facts
from tests.system.processes import wait_until

ROTATIONS, POSITIONS = "/mocap/0/joint/rot_local", "/mocap/0/joint/pos_world"
POSE = [1.0, 0.0, 0.0, 0.0] * len(FIGURE)


@pytest.fixture
def stage(folder: Path) -> Iterator[StageDouble]:
    show = facts()
    with StageDouble(folder, replace(show, phrases=(*show.phrases, LIVE))) as stage:
        yield stage


@pytest.fixture
def reader(folder: Path) -> Iterator[LivePoseReader]:
    with closing(LivePoseReader(folder)) as reader:
        yield reader


def heard(reader: LivePoseReader) -> LivePose:
    found: LivePose = wait_until(reader.read, "no pose came", pause=lambda: None)
    return found


def test_poses_of_another_program_reach_the_stage(
    stage: StageDouble, control: ControlInThread, asker: Asker, reader: LivePoseReader
) -> None:
    asker.ask("/ping")
    client = SimpleUDPClient(HOST, control.port)
    client.send_message(ROTATIONS, POSE)
    first = heard(reader)
    assert np.frombuffer(first.rotations, np.float32).tolist() == POSE
    assert all(map(math.isnan, first.root))
    client.send_message(POSITIONS, [1.5, 0.9, -2.0] + [0.0] * 3 * (len(FIGURE) - 1))
    client.send_message("/mocap/0/joint/rot_world", POSE)
    client.send_message(ROTATIONS, POSE)
    second = heard(reader)
    assert second.root == pytest.approx((1.5, 0.9, -2.0))
    assert second.arrival > first.arrival


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (POSE[:-1], f"{len(POSE) - 1} came"),
        ([*POSE, 1.0], f"{len(POSE) + 1} came"),
        (["one", *POSE[1:]], f"{len(POSE) - 1} came"),
        ([math.nan, *POSE[1:]], "a value is not a finite number"),
        ([], "0 came"),
    ],
)
def test_what_is_no_pose_of_this_figure_is_refused_in_words(
    stage: StageDouble, asker: Asker, reader: LivePoseReader, arguments: list[float], message: str
) -> None:
    reply = asker.ask(ROTATIONS, *arguments)
    assert reply[1:3] == [ROTATIONS, 0] and message in reply[3]
    assert reader.read() is None


def test_a_show_without_a_live_dancer_says_what_to_write(
    folder: Path, control: ControlInThread, asker: Asker
) -> None:
    with StageDouble(folder):
        reply = asker.ask(ROTATIONS, *POSE)
    assert "live: true" in reply[3]
