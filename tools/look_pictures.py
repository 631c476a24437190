"""docs/pictures/look*.png, by `python -m tools.look_pictures [folder]`: what each look looks like.

From those pictures it makes the small ones on the page's buttons, one a style.
"""

from __future__ import annotations

import sys
from pathlib import Path

import moderngl
import numpy as np

from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.projector.context import offscreen
from appliance.projector.moment import Floats
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.test_card import test_card
from appliance.projector.still import FINER, Image, draw_still, moment_of, shrink
from appliance.show.bundle import default_show_path
from appliance.show.look import STYLES, CameraConfig, LookConfig

SIZE = 864, 486
ADDRESS = "https://192.168.0.12:8443"
HELD = "lShldr"
UPRIGHT, TOGETHER_S = (320, 400), 49.6  # for the four looks side by side
STROKES_S, STROKES_STEP_S, SMALL = 30.0, 0.2, (192, 108)  # the dance whose strokes ink's paper has kept
SHOW = default_show_path()
SMALL_ONES, SMALL_SIZE, QUALITY = Path("appliance/console/page/looks"), (192, 144), 60  # 2 kB each
Turns = dict[str, tuple[tuple[float, float, float], float]]  # joint: axis, degrees
_DOWN: Turns = {"lShldr": ((0, 0, 1), -72), "rShldr": ((0, 0, 1), 72)}
BODY: tuple[tuple[float, Turns], ...] = (  # where the camera stands, degrees; the pose
    (-20, _DOWN),
    (150, _DOWN),
    (20, {"lShldr": ((0, 0, 1), 62), "rShldr": ((0, 0, 1), -62), "lCollar": ((0, 0, 1), 22)}),
    (70, {**_DOWN, "head": ((1, 0, 0), -38), "neck": ((1, 0, 0), -22), "chest": ((1, 0, 0), -12)}),
    (
        -35,
        {
            "lThigh": ((1, 0, 0), -85),
            "lShin": ((1, 0, 0), 80),
            "rThigh": ((1, 0, 0), 35),
            "rFoot": ((1, 0, 0), -25),
        },
    ),
    (60, {**_DOWN, "lThigh": ((1, 0, 0), -95), "lShin": ((1, 0, 0), 95), "rShin": ((1, 0, 0), 88)}),
)
CHALK = LookConfig(
    name="chalk", style="ink", figure="#f0e9da", light="#5b5550", accent="#d2452b", background="#000000"
)
PICTURES = {  # what each picture is called: the look, and the moment of the phrase in seconds
    "plaster": (LookConfig(name="plaster", style="plaster"), 17.4),
    "lines": (LookConfig(name="lines", style="lines"), 49.6),
    "ink": (LookConfig(name="ink", style="ink"), 49.6),
    "cloud": (LookConfig(name="cloud", style="cloud"), 17.4),
    "veil": (LookConfig(name="veil", style="veil"), 17.4),
    "strings": (LookConfig(name="strings", style="strings"), 17.4),
    "chalk": (CHALK, 17.4),
    "above": (LookConfig(name="above", camera=CameraConfig(elevation_deg=50, figure=0.85)), 49.6),
}


def draw_looks(folder: Path) -> list[Path]:
    """Draw all pictures into a folder and return their paths."""
    from PIL import Image as Files  # in the extra `pictures`, which the show itself does not need

    recording = read_bvh(SHOW / "phrase.bvh")
    size = SIZE[0] * FINER, SIZE[1] * FINER
    paths = []
    holds = np.zeros(len(recording.skeleton), np.float32)
    holds[recording.skeleton.index(HELD)] = 1.0
    with offscreen(size) as ctx:
        looks = {name: look for name, (look, _) in PICTURES.items()}
        renderer = Renderer(ctx, recording.skeleton, looks, keeps_strokes=True)
        for name, (_, time_s) in PICTURES.items():
            moment = moment_of(recording, time_s, holds if name == "strings" else None)
            for earlier in np.arange(time_s - STROKES_S, time_s, STROKES_STEP_S) if name == "ink" else ():
                draw_still(ctx, renderer, moment_of(recording, float(earlier)), name, SMALL)
            image = shrink(draw_still(ctx, renderer, moment, name, size))
            paths.append(folder / f"look-{name}.png")
            Files.fromarray(image).save(paths[-1], optimize=True)
        renderer.release()
        paths.append(folder / "body.png")
        Files.fromarray(_body(ctx, recording)).save(paths[-1], optimize=True)
        paths.append(folder / "look-melt.png")
        Files.fromarray(_melt(ctx, recording)).save(paths[-1], optimize=True)
        paths.append(folder / "test-card.png")
        text = ("bunraku", f"page {ADDRESS}", "pin 482913", "1280x720 kmsdrm")
        Files.fromarray(test_card((1280, 720), text, ADDRESS)).save(paths[-1], optimize=True)
        paths.append(folder / "looks.png")
        Files.fromarray(_side_by_side(ctx, recording)).save(paths[-1], optimize=True)
        paths.append(folder / "looks-held.png")
        Files.fromarray(_side_by_side(ctx, recording, holds)).save(paths[-1], optimize=True)
    return paths


def draw_small_ones(pictures: Path, folder: Path = SMALL_ONES) -> list[Path]:
    """Cut the figure out of the picture of each style, for the page's buttons; return their paths."""
    from PIL import Image as Files

    folder.mkdir(exist_ok=True)
    paths = [folder / f"{style}.webp" for style in STYLES]
    for path in paths:
        whole = Files.open(pictures / f"look-{path.stem}.png").convert("RGB")
        left = (whole.width - whole.height * SMALL_SIZE[0] / SMALL_SIZE[1]) / 2
        part = (left, 0.0, whole.width - left, float(whole.height))
        whole.resize(SMALL_SIZE, Files.Resampling.LANCZOS, part).save(path, quality=QUALITY, method=6)
    return paths


def _body(ctx: moderngl.Context, recording: Recording) -> Image:
    """The plaster figure in the poses of BODY, beside each other."""
    skeleton, pictures = recording.skeleton, []
    looks = {
        str(angle): LookConfig(
            name=str(angle),
            vignette=0.1,
            camera=CameraConfig(move="still", angle_deg=angle, figure=0.8, lens_deg=22),
        )
        for angle, _ in BODY
    }
    renderer = Renderer(ctx, skeleton, looks)
    for angle, turns in BODY:
        pose = np.tile(quaternion.IDENTITY.astype(float), (1, len(skeleton), 1))
        for name, (axis, degrees) in turns.items():
            pose[0, skeleton.index(name)] = quaternion.from_axis_angle(axis, np.radians(degrees))
        positions, world = skeleton.forward_kinematics(pose[0], np.zeros(3))
        ends = [
            positions[joint] + quaternion.rotate(world[joint], np.array(end)) for joint, end in skeleton.ends
        ]
        root = np.array([[0.0, 0.012 - min(float(end[1]) for end in ends), 0.0]])
        moment = moment_of(Recording(skeleton, pose, root, recording.fps), 0.0)
        size = UPRIGHT[0] * FINER * 3 // 4, UPRIGHT[1] * FINER
        pictures.append(shrink(draw_still(ctx, renderer, moment, str(angle), size)))
    renderer.release()
    return np.hstack(pictures)


def _melt(ctx: moderngl.Context, recording: Recording) -> Image:
    """From human to amorphous, in steps beside each other."""
    looks = {str(melt): LookConfig(name=str(melt), melt=melt) for melt in (0.0, 0.35, 0.7, 1.0)}
    renderer = Renderer(ctx, recording.skeleton, looks)
    size = UPRIGHT[0] * FINER, UPRIGHT[1] * FINER
    moment = moment_of(recording, PICTURES["plaster"][1])
    pictures = [shrink(draw_still(ctx, renderer, moment, melt, size)) for melt in looks]
    renderer.release()
    return np.hstack(pictures)


def _side_by_side(ctx: moderngl.Context, recording: Recording, holds: Floats | None = None) -> Image:
    """Four looks of one instant, upright, beside each other; holds: (J,) how firmly joints are held."""
    size = UPRIGHT[0] * FINER, UPRIGHT[1] * FINER
    looks: dict[str, LookConfig] = {style: LookConfig(name=style, style=style) for style in STYLES[:4]}
    renderer = Renderer(ctx, recording.skeleton, looks)
    moment = moment_of(recording, TOGETHER_S, holds)
    pictures = [shrink(draw_still(ctx, renderer, moment, style, size)) for style in looks]
    renderer.release()
    return np.hstack(pictures)


if __name__ == "__main__":
    into = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures")
    for path in [*draw_looks(into), *draw_small_ones(into)]:
        print(f"{path} ({path.stat().st_size // 1000} kB)")
