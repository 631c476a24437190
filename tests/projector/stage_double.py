"""A stage double that writes real shared frames, and a painter with colours that tests can read."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np

from appliance.outputs.puppet_facts import PuppetFacts
from appliance.outputs.shared_frame import Facts, FrameWriter
from appliance.pose.skeleton import Skeleton
from appliance.projector.loop import Looks
from appliance.projector.moment import Moment
from appliance.projector.picture.camera import NOT_CUED, CuedCamera
from appliance.projector.picture.wall import Wall, flat
from tests.outputs.small_stage import one_puppet

SIZE = (64, 36)


def chain(joints: int) -> Skeleton:
    """Joints one above the other."""
    offsets = np.tile([0.0, 0.1, 0.0], (joints, 1))
    offsets[0] = 0.0
    return Skeleton(tuple(f"joint{k}" for k in range(joints)), tuple(range(-1, joints - 1)), offsets)


class StageDouble:
    """Writes frames of a skeleton with this many joints, for the show in a folder."""

    def __init__(self, folder: Path, show: Path, joints: int = 3) -> None:
        skeleton = chain(joints)
        facts = Facts(
            *(show, None, "A test", skeleton, (PuppetFacts(),), ("main",), (), ("plaster",), ()),
            *(10, 9, 12, 1, 0.0),
        )
        self._writer = FrameWriter(folder, facts)
        self._frame = one_puppet(joints)
        self._frame.tick = -1

    def write(self, frame_time: float, height: float = 1.0) -> None:
        """The next frame, all joints at one height."""
        self._frame.tick += 1
        self._frame.frame_time = frame_time
        self._frame.puppets[0].positions[:, 1] = height
        self._writer.write(self._frame)

    def close(self) -> None:
        self._writer.close()


class TellingPainter:
    """Fills the picture: red is the dancer's height, green the number of joints, blue the look's share."""

    made = 0
    released = 0

    def __init__(self, gl: moderngl.Context, skeleton: Skeleton, looks: Looks, show: Path) -> None:
        type(self).made += 1
        self.looks, self._joints = looks, len(skeleton)

    def draw(
        self,
        moment: Moment,
        look: str,
        look_before: str,
        mix: float,
        target: Wall | moderngl.Framebuffer,
        cued: CuedCamera = NOT_CUED,
    ) -> None:
        wall = target if isinstance(target, Wall) else flat(target)
        colours = float(moment.puppets[0].positions[0, 1]), 0.1 * self._joints, mix
        wall.framebuffer.clear(*(wall.level * colour for colour in colours), 1.0)

    def release(self) -> None:
        type(self).released += 1


def pixels(screen: moderngl.Framebuffer, size: tuple[int, int] = SIZE) -> np.ndarray:
    """What is on the display, (height, width, 3), top row first."""
    raw = np.frombuffer(screen.read(viewport=(0, 0, *size), components=4), np.uint8)
    return raw.reshape(size[1], size[0], 4)[::-1, :, :3]
