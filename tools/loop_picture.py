"""docs/pictures/loop.webp, by `python -m tools.loop_picture [file]`: a hand, and the AI dancer's answer.

The built-in show dances in its own tick. Its worn sensor gets an arm that swings, and nothing else of a
dancer: the figure on the left only moves that arm.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from appliance.box.clock import TICK_S, Slot
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.projector.context import offscreen
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import FINER, draw_still, moment_of, shrink
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.bundle import default_show_path
from appliance.show.look import CameraConfig, LookConfig
from appliance.show.show import load_show
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import assemble
from appliance.stage.tick import Tick

SECONDS, MELT_S, BEFORE_S = 6.0, 0.6, 6.0  # the end melts into the beginning; danced before it is seen
EVERY = 4  # ticks a picture: 12.5 pictures a second
HALF = 340, 400  # pixels of one figure
QUALITY = 80
LOOK = LookConfig(
    name="plaster", style="plaster", camera=CameraConfig(move="still", angle_deg=-15.0, figure=0.8)
)
SENSOR, JOINT = "left-wrist", "lShldr"
HANG = -80.0  # degrees about z, from the T of the rest pose
BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
CAPTIONS = "A dancer wears one sensor on one arm", "The AI dancer answers with the whole body"


def draw_loop(path: Path) -> Path:
    """Dance, draw both figures, and write them as a WebP that repeats."""
    worn, danced = _dance()
    count = round(SECONDS / TICK_S / EVERY)
    melted = round(MELT_S / TICK_S / EVERY)
    pictures = [np.hstack(pair) for pair in zip(_drawn(worn), _drawn(danced), strict=True)]
    for number in range(melted):
        share = (number + 1) / (melted + 1)
        mixed = share * pictures[number] + (1 - share) * pictures[count + number]
        pictures[number] = mixed.astype(np.uint8)
    frames = [_captioned(picture) for picture in pictures[:count]]
    length_ms = round(1000 * TICK_S * EVERY)
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=length_ms, loop=0, quality=QUALITY, method=6
    )
    return path


def arm_at(time_s: float) -> Array:
    """The upper arm, local to the chest, after `time_s`: it hangs, swings up to the side and to the front."""
    phase = 2 * math.pi * time_s / SECONDS
    raised = HANG + 130.0 * (0.5 - 0.5 * math.cos(2 * phase)) * (0.75 + 0.25 * math.cos(phase))
    forward = 55.0 * math.sin(phase)
    side = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), math.radians(raised))
    front = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), math.radians(-forward))
    return np.asarray(quaternion.multiply(front, side))


def _dance() -> tuple[Recording, Recording]:
    """The dancer, of whom one arm moves, and the puppet that this arm leads."""
    show = load_show(default_show_path())
    parts = assemble(show, BOX)
    (hand,) = parts.worn[SENSOR]
    hand.wear(np.eye(4, dtype=np.float32))  # readings are the joint's own orientations
    tick = Tick(parts, SensorFit(parts, SensorMemory(None)), TICK_S)
    still = np.tile(quaternion.IDENTITY.astype(float), (len(show.skeleton), 1))
    other = show.skeleton.index(JOINT.replace("l", "r", 1))
    still[other] = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), math.radians(-HANG))
    worn, poses, roots = [], [], []
    for number in range(round((BEFORE_S + SECONDS + MELT_S) / TICK_S)):
        now = number * TICK_S
        arm = arm_at(now - BEFORE_S)
        hand.take_reading(arm.tolist(), now, now)
        slot = Slot(number, now, now, 0)
        tick.run(slot)
        tick.after(slot)
        if now >= BEFORE_S:
            still[show.skeleton.index(JOINT)] = arm
            worn.append(still.copy())
            poses.append(tick.frame.puppets[0].pose.copy())
            roots.append(tick.frame.puppets[0].root.copy())
    parts.close()
    standing = np.tile(np.array([0.0, roots[0][1], 0.0]), (len(worn), 1))
    return (
        Recording(show.skeleton, np.array(worn), standing, 1 / TICK_S),
        Recording(show.skeleton, np.array(poses), np.array(roots), 1 / TICK_S),
    )


def _drawn(recording: Recording) -> list[NDArray[np.uint8]]:
    """Every picture of a dance as the wall shows it, the held joint in colour."""
    holds = np.zeros(len(recording.skeleton), np.float32)
    holds[recording.skeleton.index(JOINT)] = 1.0
    size, times = (HALF[0] * FINER, HALF[1] * FINER), np.arange(0, len(recording), EVERY) / recording.fps
    with offscreen(size) as ctx:
        renderer = Renderer(ctx, recording.skeleton, {LOOK.name: LOOK}, default_show_path())
        moments = (moment_of(recording, float(time_s), holds) for time_s in times)
        pictures = [shrink(draw_still(ctx, renderer, moment, LOOK.name, size)) for moment in moments]
        renderer.release()
    return pictures


def _captioned(picture: NDArray[np.uint8]) -> Image.Image:
    image = Image.fromarray(picture)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(15)
    for number, text in enumerate(CAPTIONS):
        middle = (number + 0.5) * HALF[0], HALF[1] - 18
        pen.text(middle, text, font=font, fill=(200, 192, 180), anchor="mm")
    return image


if __name__ == "__main__":
    drawn = draw_loop(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/loop.webp"))
    print(f"{drawn} ({drawn.stat().st_size // 1000} kB)")
