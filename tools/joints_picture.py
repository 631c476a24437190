"""docs/pictures/joints.png, by `python -m tools.joints_picture [file]`: the built-in dancer's joints."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from appliance.pictures.figure import Frame, render
from appliance.pictures.filmstrip_stage import straight
from appliance.pose import quaternion
from appliance.pose.body import Body
from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path

SIZE, PER_METRE = (960, 760), 390.0
MIDDLE = 480, 728  # the pixel of the floor below the hips
BACKDROP, INK, FAINT, DOT = (15, 16, 21), (239, 230, 216), (120, 116, 110), (245, 69, 42)
IVORY = np.array([0.93, 0.87, 0.78])
FINGERS = ("Thumb", "Index", "Mid", "Ring", "Pinky", "Eye")
UP = {  # joints named above them: pixels outwards and upwards from the joint to the middle of its name
    "lCollar": (78, 92),
    "lShldr": (40, 56),
    "lForeArm": (34, 56),
    "lHand": (20, 60),
    "neck": (-130, 118),
    "head": (0, 112),
}
BESIDE = {  # joints named beside the figure: pixels from its middle, and upwards
    "chest": (170, 0),
    "abdomen": (170, 0),
    "lButtock": (170, 22),
    "lThigh": (170, -2),
    "hip": (170, -26),
    "lShin": (130, 0),
    "lFoot": (130, 0),
}


def draw_joints(path: Path) -> Path:
    """The rest pose from the front, each joint a dot with its name; fingers and eyes are left out."""
    skeleton = read_bvh(default_show_path() / "skeleton.bvh").skeleton
    pose = np.tile(quaternion.IDENTITY.astype(float), (len(skeleton), 1))
    positions, world = skeleton.forward_kinematics(pose, np.zeros(3))
    lift = -np.array([0.0, float(positions[:, 1].min()), 0.0])
    cones = Body(skeleton).cones(positions + lift, world)
    frame = Frame(*SIZE, *MIDDLE, PER_METRE)
    image = Image.new("RGB", SIZE, BACKDROP)
    figure = straight(render(cones, np.tile(IVORY, (len(cones.joint), 1)), frame))
    drawn = Image.fromarray((255 * np.clip(figure * [1, 1, 1, 0.75], 0, 1)).astype(np.uint8), "RGBA")
    image.paste(drawn, mask=drawn)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(17)
    for joint, name in enumerate(skeleton.names):
        if any(finger in name for finger in FINGERS):
            continue
        x, y, _ = PER_METRE * (positions[joint] + lift)
        at = MIDDLE[0] + x, MIDDLE[1] - y
        pen.ellipse((at[0] - 4, at[1] - 4, at[0] + 4, at[1] + 4), fill=DOT)
        word = _word_at(name, at)
        pen.line((at, word), fill=FAINT, width=1)
        box = pen.textbbox(word, name, font=font, anchor="mm")
        pen.rectangle((box[0] - 3, box[1] - 2, box[2] + 3, box[3] + 2), fill=BACKDROP)
        pen.text(word, name, font=font, fill=INK, anchor="mm")
    pen.text((150, 30), "the dancer's right", font=font, fill=FAINT, anchor="mm")
    pen.text((810, 30), "the dancer's left", font=font, fill=FAINT, anchor="mm")
    image.quantize(64).save(path, optimize=True)
    return path


def _word_at(name: str, at: tuple[float, float]) -> tuple[float, float]:
    """The middle of a joint's name; the right side mirrors the left."""
    left, side = ("l" + name[1:], -1) if name.startswith("r") else (name, 1)
    if left in UP:
        right, up = UP[left]
        return at[0] + side * right, at[1] - up
    right, up = BESIDE[left]
    return MIDDLE[0] + side * right, at[1] - up


if __name__ == "__main__":
    print(draw_joints(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/joints.png")))
