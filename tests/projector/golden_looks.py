"""Golden pictures of the looks: how they are drawn and compared; run as a module it draws them again.

Two rasterizers that share no code, Mesa's llvmpipe and softpipe, draw these pictures with mean differences of
up to 0.4 steps of 255 and 9 steps at the 99th percentile, after a blur of three pixels that forgives an edge
in the next pixel. The same looks two ticks later differ by at least 2.5 and 50 steps. The limits lie between.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.projector.context import offscreen
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of
from appliance.show.bundle import default_show_path
from appliance.show.look import STYLES, LookConfig, looks_by_name

FOLDER = Path(__file__).resolve().parents[1] / "golden" / "looks"
SIZE = 320, 180
AT_S = 17.4
MEAN_LIMIT, P99_LIMIT = 1.0, 20.0

Picture = NDArray[np.uint8]


def phrase() -> Recording:
    """The default show's phrase."""
    return read_bvh(default_show_path() / "phrase.bvh")


@contextmanager
def renderer(
    ctx: moderngl.Context,
    skeleton: Skeleton,
    looks: Mapping[str, LookConfig] | None = None,
) -> Iterator[Renderer]:
    """A renderer of the built-in looks, or of others."""
    made = Renderer(ctx, skeleton, looks or looks_by_name(()))
    yield made
    made.release()


def difference(a: Picture, b: Picture) -> tuple[float, float]:
    """The difference of two pictures in steps of 255: mean and 99th percentile, after a small blur."""
    apart = np.abs(_blurred(a) - _blurred(b))
    return float(apart.mean()), float(np.percentile(apart, 99))


def _blurred(picture: Picture) -> NDArray[np.float64]:
    padded = np.pad(picture.astype(float), ((1, 1), (1, 1), (0, 0)), mode="edge")
    height, width = picture.shape[:2]
    shifted = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(np.mean(shifted, axis=0))


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    dance = phrase()
    with offscreen(SIZE) as gl, renderer(gl, dance.skeleton) as looks:
        for style in STYLES:
            image = draw_still(gl, looks, moment_of(dance, AT_S), style, SIZE)
            Image.fromarray(image).save(FOLDER / f"{style}.png", optimize=True)
