"""A stage that shares its frames, as small as a test needs it: its facts, and a process that writes."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from appliance.outputs.shared_frame import Facts
from appliance.pose.skeleton import Skeleton

NOW = 1000.0
WRITES = """
import sys, time
from pathlib import Path
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import FrameWriter
from tests.outputs.small_stage import facts_of, small
joints = int(sys.argv[2])
writer, frame = FrameWriter(Path(sys.argv[1]), facts_of(small(joints))), JointFrame(joints)
pause_s = float(sys.argv[3])
while True:
    frame.tick += 1
    frame.frame_time = 1e-6 * frame.tick
    for numbers in (frame.pose, frame.world, frame.positions, frame.root, frame.holds):
        numbers.fill(frame.tick % 65536)
    writer.write(frame)
    if frame.tick == 1:
        print("written", flush=True)
    time.sleep(pause_s) if pause_s else None
"""


def small(joints: int) -> Skeleton:
    return Skeleton(tuple(map(str, range(joints))), tuple(range(-1, joints - 1)), np.zeros((joints, 3)))


def facts_of(skeleton: Skeleton) -> Facts:
    return Facts(
        show_directory=Path("/shows/evening"),
        box_file=None,
        show_name="Evening",
        skeleton=skeleton,
        held=(2,),
        hands=("left-wrist",),
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
