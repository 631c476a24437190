"""The pictures of each look for the documentation: `python -m appliance.projector.gallery [folder]`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

import appliance.show
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.projector.context import offscreen
from appliance.projector.moment import Moment
from appliance.projector.picture.renderer import Renderer
from appliance.show.look import STYLES, CameraConfig, LookConfig

SIZE = 864, 486
FINER = 2  # drawn so many times larger and then shrunk, as a projector's pixels melt on the wall
UPRIGHT, TOGETHER_S = (320, 400), 49.6  # of the four looks beside each other
TRAIL_S = 1.2
SHOW = Path(appliance.show.__file__).parent / "default_show"
CHALK = LookConfig(
    name="chalk", style="ink", figure="#f0e9da", light="#5b5550", accent="#d2452b", background="#000000"
)
PICTURES = {  # what each picture is called: the look, and the moment of the phrase in seconds
    "plaster": (LookConfig(name="plaster", style="plaster"), 17.4),
    "lines": (LookConfig(name="lines", style="lines"), 49.6),
    "ink": (LookConfig(name="ink", style="ink"), 49.6),
    "cloud": (LookConfig(name="cloud", style="cloud"), 17.4),
    "veil": (LookConfig(name="veil", style="veil"), 17.4),
    "chalk": (CHALK, 17.4),
    "above": (LookConfig(name="above", camera=CameraConfig(elevation_deg=50, figure=0.85)), 17.4),
}


Image = NDArray[np.uint8]


def moment_of(recording: Recording, time_s: float, held: Sequence[int] = ()) -> Moment:
    """The dance of a recording at one time, with what came before it."""
    last = min(round(time_s * recording.fps), len(recording) - 1)
    first = max(0, last - round(TRAIL_S * recording.fps))
    positions, world = recording.skeleton.forward_kinematics(
        recording.poses[first : last + 1].astype(np.float32),
        recording.roots[first : last + 1].astype(np.float32),
    )
    return Moment(
        time_s=last / recording.fps,
        positions=positions[-1],
        world=world[-1],
        trail=list(zip(positions, world, strict=True)),
        trail_times=[index / recording.fps for index in range(first, last + 1)],
        held=tuple(held),
    )


def drawn(
    ctx: moderngl.Context, renderer: Renderer, moment: Moment, look: str, size: tuple[int, int]
) -> Image:
    """One look of a moment as an image (height, width, 3), the upper row first."""
    target = ctx.framebuffer([ctx.texture(size, 4)])
    try:
        target.clear()
        renderer.draw(moment, look, look, 1.0, target)
        pixels = np.frombuffer(target.read(components=4), np.uint8).reshape(size[1], size[0], 4)
    finally:
        target.color_attachments[0].release()
        target.release()
    return pixels[::-1, :, :3].copy()


def gallery(folder: Path) -> list[Path]:
    """Draw all pictures into a folder; returns them."""
    from PIL import Image as Files  # of the extra `pictures`, which the show itself runs without

    recording = read_bvh(SHOW / "phrase.bvh")
    size = SIZE[0] * FINER, SIZE[1] * FINER
    paths = []
    with offscreen(size) as ctx:
        renderer = Renderer(
            ctx, size, recording.skeleton, {name: look for name, (look, _) in PICTURES.items()}
        )
        for name, (_, time_s) in PICTURES.items():
            image = Files.fromarray(drawn(ctx, renderer, moment_of(recording, time_s), name, size))
            paths.append(folder / f"look-{name}.png")
            image.resize(SIZE, Files.Resampling.BOX).save(paths[-1], optimize=True)
        renderer.release()
        paths.append(folder / "looks.png")
        Files.fromarray(_side_by_side(ctx, recording)).save(paths[-1], optimize=True)
    return paths


def _side_by_side(ctx: moderngl.Context, recording: Recording) -> Image:
    """Four looks of one instant, upright, beside each other."""
    size = UPRIGHT[0] * FINER, UPRIGHT[1] * FINER
    looks: dict[str, LookConfig] = {
        style: LookConfig(name=style, style=style, vignette=0.2) for style in STYLES[:4]
    }
    renderer = Renderer(ctx, size, recording.skeleton, looks)
    moment = moment_of(recording, TOGETHER_S)
    pictures = np.hstack([drawn(ctx, renderer, moment, style, size) for style in looks]).astype(np.uint16)
    renderer.release()
    height, width = pictures.shape[0] // FINER, pictures.shape[1] // FINER
    fine = pictures.reshape(height, FINER, width, FINER, 3)
    return np.asarray(fine.mean(axis=(1, 3)), np.uint8)


if __name__ == "__main__":
    for path in gallery(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures")):
        print(f"{path} ({path.stat().st_size // 1000} kB)")
