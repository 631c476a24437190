"""A stage that shares its frames, as small as a test needs it: its facts, and a process that writes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.osc.dialects import Encoder
from appliance.outputs.puppet_facts import HandFacts, PuppetFacts
from appliance.outputs.shared_frame import Facts
from appliance.pose.skeleton import Skeleton

NOW = 1000.0
NUMBERS = ("pose", "world", "positions", "root", "holds")
WRITES = """
import sys, time
from pathlib import Path
from appliance.outputs.shared_frame import FrameWriter
from tests.outputs.small_stage import NUMBERS, facts_of, one_puppet, small
joints = int(sys.argv[2])
writer, frame = FrameWriter(Path(sys.argv[1]), facts_of(small(joints))), one_puppet(joints)
pause_s = float(sys.argv[3])
while True:
    frame.tick += 1
    frame.frame_time = 1e-6 * frame.tick
    for name in NUMBERS:
        getattr(frame.puppets[0], name).fill(frame.tick % 65536)
    writer.write(frame)
    if frame.tick == 1:
        print("written", flush=True)
    time.sleep(pause_s) if pause_s else None
"""


def small(joints: int) -> Skeleton:
    return Skeleton(tuple(map(str, range(joints))), tuple(range(-1, joints - 1)), np.zeros((joints, 3)))


def one_puppet(joints: int, **head: Any) -> JointFrame:
    return JointFrame((PuppetFrame.of(joints),), **head)


def stand(frame: JointFrame, skeleton: Skeleton) -> None:
    """Put its one puppet's pose and root into the world."""
    (puppet,) = frame.puppets
    puppet.positions[:], puppet.world[:] = skeleton.forward_kinematics(puppet.pose, puppet.root)


def together(*frames: JointFrame) -> JointFrame:
    return replace(frames[0], puppets=tuple(puppet for frame in frames for puppet in frame.puppets))


def encoded(encoder: Encoder, frame: JointFrame) -> Sequence[memoryview]:
    return encoder.encode(frame, frame.puppets[0])


def facts_of(skeleton: Skeleton) -> Facts:
    return Facts(
        show_directory=Path("/shows/evening"),
        box_file=None,
        show_name="Evening",
        skeleton=skeleton,
        puppets=(PuppetFacts(hands=(HandFacts(skeleton.names[2], "left-wrist"),)),),
        phrases=("main", "quiet"),
        cues=({"name": "opening", "fade_s": 2.0},),
        looks=("plaster",),
        lights=("warm",),
        coding=10,
        interaction=9,
        most_iterations=24,
        pid=os.getpid(),
        started=NOW,
    )
