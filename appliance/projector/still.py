"""Stills: one instant of a recording drawn offscreen, as the projector would show it."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from appliance.pose.recording import Recording
from appliance.projector.moment import TRAIL_S, Floats, Moment, PuppetMoment
from appliance.projector.picture.renderer import Renderer

FINER = 2  # drawn this many times larger and then shrunk, as a projector's pixels melt on the wall

Image = NDArray[np.uint8]


def moment_of(recording: Recording, time_s: float, holds: Floats | None = None) -> Moment:
    """The dance of a recording at one time, with what came before it; holds: (J,) weights."""
    last = min(round(time_s * recording.fps), len(recording) - 1)
    first = max(0, last - round(TRAIL_S * recording.fps))
    positions, world = recording.skeleton.forward_kinematics(
        recording.poses[first : last + 1].astype(np.float32),
        recording.roots[first : last + 1].astype(np.float32),
    )
    puppet = PuppetMoment(positions[-1], world[-1], list(zip(positions, world, strict=True)), holds)
    times = [index / recording.fps for index in range(first, last + 1)]
    return Moment(last / recording.fps, times, (puppet,))


def draw_still(
    ctx: moderngl.Context, renderer: Renderer, moment: Moment, look: str, size: tuple[int, int]
) -> Image:
    """Draw one look of a moment: an image (height, width, 3), top row first."""
    target = ctx.framebuffer([ctx.texture(size, 4)])
    try:
        target.clear()
        renderer.draw(moment, look, look, 1.0, target)
        pixels = np.frombuffer(target.read(components=4), np.uint8).reshape(size[1], size[0], 4)
    finally:
        target.color_attachments[0].release()
        target.release()
    return pixels[::-1, :, :3].copy()


def shrink(image: Image) -> Image:
    """Shrink an image drawn FINER times too large: each pixel is the mean of those in its place.

    It is dithered again, because rounded means are bands where light fades; black stays black.
    """
    height, width = image.shape[0] // FINER, image.shape[1] // FINER
    fine = image.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
    across, up = np.arange(width), np.arange(height)[:, None]
    grain = 52.9829189 * ((0.06711056 * across + 0.00583715 * up) % 1.0) % 1.0 - 0.5  # tone.glsl's
    return np.asarray(np.clip((fine + 0.999 * grain[..., None]).round(), 0, 255), np.uint8)
