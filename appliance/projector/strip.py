"""A strip of rendered pictures: instants of a dance side by side, as the projector shows them, in one PNG."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.projector.context import offscreen
from appliance.projector.moment import Moment
from appliance.projector.picture.renderer import Renderer
from appliance.projector.projector_error import NO_DISPLAY, ProjectorError
from appliance.projector.still import FINER, Image, draw_still, moment_of, shrink
from appliance.show.look import LookConfig

COLUMNS, ROWS = 5, 2
PICTURE = (320, 400)  # pixels of one instant
VIGNETTE = 0.0  # pictures side by side need no black around them


def render_strip(
    out: Path,
    recordings: Sequence[Recording],
    looks: Mapping[str, LookConfig],
    look: str,
    holds: Array | None = None,
) -> Path:
    """Render ten instants at equal distances, the last one at the end, into `out`; returns it.

    recordings: one of each of P puppets, equally long; holds: (N, P, J) how firmly hands hold each joint,
    0..1. Raises ProjectorError where nothing can be rendered here, OSError where `out` cannot be written.
    """
    skeleton, fps, length = recordings[0].skeleton, recordings[0].fps, len(recordings[0])
    chosen = np.unique(np.linspace(0, length - 1, COLUMNS * ROWS + 1)[1:].round().astype(int))
    moments = []
    for last in chosen.tolist():
        held = [None] * len(recordings) if holds is None else holds[last].astype(np.float32)
        each = [moment_of(one, last / fps, hold) for one, hold in zip(recordings, held, strict=True)]
        puppets = tuple(puppet for moment in each for puppet in moment.puppets)
        moments.append(replace(each[0], puppets=puppets))
    framed = {name: _framed(one) for name, one in looks.items()}
    pictures = list(_render(skeleton, framed, look, moments))
    pictures += [np.zeros_like(pictures[0])] * (-len(pictures) % COLUMNS)
    rows = [np.hstack(pictures[at : at + COLUMNS]) for at in range(0, len(pictures), COLUMNS)]
    _save(out, np.vstack(rows))
    return out


def _framed(look: LookConfig) -> LookConfig:
    """The look with a figure that fills these upright pictures as high as it would fill a square."""
    figure = min(0.9, look.camera.figure * PICTURE[1] / PICTURE[0])
    camera = look.camera.model_copy(update={"figure": figure})
    return look.model_copy(update={"camera": camera, "vignette": VIGNETTE})


def _render(
    skeleton: Skeleton, looks: Mapping[str, LookConfig], look: str, moments: Sequence[Moment]
) -> Iterator[Image]:
    """Pictures (height, width, 3), top row first."""
    size = FINER * PICTURE[0], FINER * PICTURE[1]
    with offscreen(size) as gl:
        renderer = Renderer(gl, skeleton, looks)
        for moment in moments:
            yield shrink(draw_still(gl, renderer, moment, look, size))
        renderer.release()


def _save(out: Path, picture: Image) -> None:
    try:
        from PIL import Image as Files
    except ImportError as error:
        raise ProjectorError(
            f"Pictures need Pillow ({error}). Install it: pip install 'bunraku[pictures]'.", NO_DISPLAY
        ) from error
    out.parent.mkdir(parents=True, exist_ok=True)
    Files.fromarray(picture).save(out)
