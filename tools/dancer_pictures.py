"""docs/pictures/dancer-*.png, by `python -m tools.dancer_pictures [folder]`: the bundled shows' dancers."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from appliance.pose.bvh import read_bvh
from appliance.projector.context import offscreen
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import FINER, draw_still, moment_of, shrink
from appliance.show.bundle import bundled_shows
from appliance.show.look import CameraConfig, LookConfig
from appliance.show.show import load_show

SIZE = 200, 250  # pixels of one instant
INSTANTS, APART_S, BEGINS_S = 6, 0.6, 5.0
CAMERA = CameraConfig(move="still", figure=0.85)


def draw_dancers(folder: Path) -> list[Path]:
    """Draw instants of each phrase, in the show's first look, and return the paths of the pictures."""
    from PIL import Image as Files  # in the extra `pictures`, which the show itself does not need

    size, paths = (SIZE[0] * FINER, SIZE[1] * FINER), []
    for name, directory in bundled_shows().items():
        show = load_show(directory)
        phrase = read_bvh(show.phrase)
        first = show.config.looks[0] if show.config.looks else LookConfig(name="plaster", style="plaster")
        look = first.model_copy(update={"camera": CAMERA, "vignette": 0.0})
        with offscreen(size) as ctx:
            renderer = Renderer(ctx, phrase.skeleton, {look.name: look})
            moments = [moment_of(phrase, BEGINS_S + APART_S * number) for number in range(INSTANTS)]
            pictures = [shrink(draw_still(ctx, renderer, moment, look.name, size)) for moment in moments]
            renderer.release()
        paths.append(folder / f"dancer-{name}.png")
        Files.fromarray(np.hstack(pictures)).save(paths[-1], optimize=True)
    return paths


if __name__ == "__main__":
    for path in draw_dancers(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures")):
        print(f"{path} ({path.stat().st_size // 1000} kB)")
