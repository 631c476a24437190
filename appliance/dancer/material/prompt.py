"""Prompt: the part of a loop from which an improvisation goes on, as steps that travel with its recipe.

The improvisation begins CLOSING frames after the prompt's first step, and dances the rest of the prompt
again. Until it ends, both dance the same steps, and the two can be melted into each other.
"""

from __future__ import annotations

import base64
import binascii

import numpy as np

from appliance.dancer.loop import Loop
from appliance.dancer.material.improvising import BEFORE, MOVE, Numbers
from appliance.dancer.material.motion_network import Poses
from appliance.dancer.material.steps import HOP, MIDDLE, WINDOW, Coder, Steps, steps_of
from appliance.dancer.phrase import FPS, SHARED, X, Z
from appliance.dancer.playhead import Playhead, Reader
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

STEPS = BEFORE + 2 * MOVE
FRAMES = HOP * STEPS + WINDOW  # for a loop, whose first window only shows the direction of the first step
CLOSING = HOP * (STEPS - 1) - SHARED  # frames in which it comes round, if nothing is there to go on with
BEGINS = HOP + MIDDLE + CLOSING  # the prompt's frame with which the improvisation begins
_LAST_PART = 0.8  # fraction of an improvisation after which its closing frame is chosen


def prompt_of(loop: Loop, frame: float, skeleton: Skeleton, coder: Coder, places: list[int]) -> str:
    """The prompt for an improvisation that begins at a frame of a loop, which goes on round its end."""
    first = frame - BEGINS
    head = Playhead(loop, first + loop.period if first < 0 else first, loop.poses[0].copy())
    poses, track = np.empty((FRAMES, *loop.poses.shape[1:]), np.float32), loop.track[0].copy()
    roots, reader = np.empty((FRAMES, 3)), Reader(len(skeleton))
    for row in range(FRAMES):
        reader.read(head, track)
        poses[row], roots[row] = head.pose, track[X : Z + 1]
        head.move(1.0)
    return packed_steps(steps_of(coder, Recording(skeleton, poses, roots, FPS), places))


def end_of(loop: Loop) -> int:
    """The frame of an improvisation at which the next one begins: its prompt ends before the closing."""
    return max(0, loop.length - CLOSING - (FRAMES - BEGINS))


def homed(roots: Array) -> Array:
    """Roots (N, 3) of a dance that ends with the closing, led back to where it begins by the time that the
    next one does: parts that go on from each other for hours stay on the stage.
    """
    first, last = CLOSING + SHARED, len(roots) - CLOSING - (FRAMES - BEGINS)
    share = np.clip((np.arange(len(roots)) - first) / max(last - first, 1), 0.0, 1.0)
    led = roots.copy()
    led[:, [0, 2]] -= share[:, None] * (roots[last] - roots[CLOSING])[[0, 2]]
    return led


def packed_steps(steps: Steps) -> str:
    """Steps as text, each number in 16 bits."""
    return base64.b64encode(steps.features.astype("<f2").tobytes()).decode("ascii")


def unpacked_steps(text: str, features: int) -> Numbers:
    """Features (STEPS, F). Raises ValueError for other text."""
    try:
        numbers = np.frombuffer(base64.b64decode(text, validate=True), "<f2")
        steps = numbers.reshape(STEPS, features).astype(np.float32)
    except (binascii.Error, ValueError):
        raise ValueError("the prompt is not of this network") from None
    if not np.isfinite(steps).all():
        raise ValueError("the prompt holds numbers that are not finite")
    return steps


def closing_frame(poses: Poses) -> int:
    """How many of the poses (N, M, 4) to keep, so that the closing finds a figure most like the first one."""
    few = poses.astype(np.float64)
    few[:, 0] = quaternion.multiply(quaternion.inverse(quaternion.heading(few[:, 0])), few[:, 0])
    starts = np.arange(round(_LAST_PART * (len(few) - CLOSING)), len(few) - CLOSING + 1)
    apart = np.zeros(len(starts))
    for at in (0, CLOSING // 2, CLOSING - 1):  # the same figures, moving the same way
        apart += (quaternion.angle_between(few[starts + at], few[at]) ** 2).mean(axis=1)
    return int(starts[apart.argmin()]) + CLOSING
