"""The last step of each picture: from the drawn scene onto the wall, through corner-pin and levels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from appliance.projector.controls import Controls
from appliance.projector.corners import homography
from appliance.projector.masks import Masks
from appliance.projector.page import page
from appliance.projector.picture.drawing import Drawing
from appliance.projector.picture.wall import DETAILS, FLAT, Detail, Wall, flat
from appliance.projector.warp import FINE, Warp, fine
from appliance.projector.window import Size
from appliance.show.projector import EdgeBlendConfig, ProjectorConfig

_NO_SIZE = (1, 1)  # size of an absent picture
_MARKER_RADIUS = 28.0  # pixels
_TEXT_ROWS = 160  # letters are as large as on a display of this many rows of pixels
_TOE = {"projector": 0.06, "screen": 0.0}  # share of white: a projector shows fainter air as a grey rectangle
_DITHER_STEP = 0.618034  # pixels: no two neighbouring pictures have the same pattern
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
_CLIP_FROM_DISPLAY = np.array([[2.0, 0.0, -1.0], [0.0, -2.0, 1.0], [0.0, 0.0, 1.0]])  # y down


@dataclass(frozen=True)
class Part:
    """The part of the picture that this display shows: its start and its width, as fractions of the whole
    width.
    """

    begin: float
    width: float


def part_of(blend: EdgeBlendConfig | None) -> Part:
    """The whole picture without edge blend; else one side of it."""
    if blend is None:
        return Part(0.0, 1.0)
    width = 1.0 / (2.0 - blend.overlap)
    return Part(0.0 if blend.part == "left" else 1.0 - width, width)


def picture_size(config: ProjectorConfig, display: Size, share: float = 1.0) -> Size:
    """Pixels that the scene is drawn in: a share of the display's unless the box file says otherwise."""
    width, height = config.picture or (round(display[0] * share), round(display[1] * share))
    return max(1, round(width / part_of(config.edge_blend).width)), max(1, height)


class FinalPass:
    """Owns the picture's texture and the programs that lay it onto the wall, one of them with marks.

    Where no edges are blended and no marks shown, a look does most of it or all: `wall`.
    """

    def __init__(self, gl: moderngl.Context, config: ProjectorConfig) -> None:
        self._gl, self._config = gl, config
        self._part = part_of(config.edge_blend)
        fixed = ["GAMMA"] * (config.gamma != 1.0) + ["BLEND"] * (config.edge_blend is not None)
        self._is_graded = False  # whether the picture has its brightness and gamma already
        self._unchanged, self._dimmed, self._marked = (
            Drawing(gl, "final", "final", parts=parts)
            for parts in ([], [*fixed, "DIM"], [*fixed, "DIM", "MARKS"])
        )
        self._warped_parts = [*fixed, "DIM", "MARKS", "WARP"]
        self._warped: Drawing | None = None  # few walls need it
        self._offsets = gl.texture((FINE, FINE), 4, dtype="f2")
        self._offsets.repeat_x = self._offsets.repeat_y = False
        self._offset_by: Warp | None = None
        self._masks = Masks(gl, config.masks)
        self._text = gl.texture((1, 1), 1)
        self._written: tuple[object, ...] = ()
        self._pictures = 0
        self._texture, self.picture = self._target((1, 1))

    def wall(
        self,
        screen: moderngl.Framebuffer,
        display: Size,
        controls: Controls,
        level: float,
        size: Size,
        lines: tuple[str, ...] = (),
        detail: Detail = DETAILS[0],
    ) -> Wall:
        """The target for a look's picture of that size and detail; `draw` does the rest.

        That is the display itself if nothing is left to do, which saves a small computer from writing the
        picture to memory and reading it back; else a texture.
        """
        scale, gamma = level * controls.alignment.brightness, self._config.gamma
        toe = _TOE[self._config.wall]
        has_marks = bool(lines) or controls.shows_grid or bool(controls.alignment.warp)
        self._is_graded = self._config.edge_blend is None and not has_marks
        if self._is_graded and size == display:
            self.resize(_NO_SIZE)
            clip_from_picture = self._clip_from_part(controls) @ _Y_UP
            return Wall(screen, display, size, clip_from_picture, scale, gamma, detail=detail, toe=toe)
        self.resize(size)
        if not self._is_graded:
            return replace(flat(self.picture), detail=detail, toe=toe)
        finer = 1.0 if self._config.picture else display[1] / size[1]
        return Wall(self.picture, size, size, FLAT, scale, gamma, finer, detail, toe)

    def show_image(self, image: NDArray[np.uint8]) -> None:
        """An image (height, width, 3), top row first, in place of a look's picture; `draw` does the rest."""
        self._is_graded = False
        self.resize((image.shape[1], image.shape[0]))
        opaque = np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])
        self._texture.write(np.ascontiguousarray(opaque[::-1]).tobytes())

    def resize(self, size: Size) -> None:
        """The size in which the scene is drawn, pixels."""
        if self.picture.size != size:
            self._release_picture()
            self._texture, self.picture = self._target(size)

    def draw(
        self,
        screen: moderngl.Framebuffer,
        display: Size,
        controls: Controls,
        level: float,
        lines: tuple[str, ...],
    ) -> None:
        """Lay the picture onto the display. level 0..1; `lines`: figures to show, maybe none."""
        scale = level * controls.alignment.brightness
        warp = controls.alignment.warp
        has_marks = bool(lines) or controls.shows_grid or bool(warp)
        self.black(screen, display)
        if scale == 0.0 and not has_marks:
            return
        self._gl.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        inputs = {
            "picture": self._texture,
            "part": (self._part.begin, self._part.width),
            **self._light(scale),
        }
        if has_marks:
            inputs |= self._place(display, controls) | self._mark(lines, display, controls)
            if warp:
                self._warped = self._warped or Drawing(self._gl, "final", "final", parts=self._warped_parts)
                self._warped.draw(inputs | {"offsets": self._fine_offsets(warp)})
            else:
                self._marked.draw(inputs)
        else:
            inputs["clip_from_part"] = self._clip_from_part(controls)
            drawing = self._unchanged if self._is_graded else self._dimmed
            drawing.draw(inputs, moderngl.TRIANGLE_STRIP, 4)

    def mask(self, screen: moderngl.Framebuffer, display: Size, controls: Controls) -> None:
        """Darken what the box file's masks cover; the very last step of a picture."""
        self._masks.draw(screen, display, self._flips(controls), controls.shows_grid)

    def black(self, screen: moderngl.Framebuffer, display: Size) -> None:
        """Clear the display: no picture, no figures, no marks."""
        screen.use()
        screen.viewport = (0, 0, *display)
        screen.clear(0.0, 0.0, 0.0, 0.0)

    def release(self) -> None:
        """Give the GPU's memory back."""
        self._release_picture()
        for owned in (self._masks, self._text, self._offsets, self._unchanged, self._dimmed, self._marked):
            owned.release()
        if self._warped is not None:
            self._warped.release()

    def _fine_offsets(self, warp: Warp) -> moderngl.Texture:
        """The warp between its points too, as a texture of shares of the display."""
        if warp != self._offset_by:
            offsets = np.zeros((FINE, FINE, 4), np.float16)
            offsets[..., :2] = fine(warp)
            self._offsets.write(offsets.tobytes())
            self._offset_by = warp
        return self._offsets

    def _clip_from_part(self, controls: Controls) -> NDArray[np.float64]:
        """(3, 3) from the unit square of this display's part of the picture (y down) to clip space."""
        across, upside_down = self._flips(controls)
        flipped = np.diag([1.0 - 2.0 * across, 1.0 - 2.0 * upside_down, 1.0])
        flipped[:2, 2] = across, upside_down
        return np.asarray(_CLIP_FROM_DISPLAY @ flipped @ homography(controls.alignment.corners))

    def _flips(self, controls: Controls) -> tuple[float, float]:
        """1 where left and right, top and bottom of the wall are exchanged on the display."""
        upside_down = self._config.upside_down
        return float(controls.alignment.mirror != upside_down), float(upside_down)

    def _place(self, display: Size, controls: Controls) -> dict[str, Any]:
        """The picture's place on the display."""
        width, height = display
        wall_from_picture = np.diag([width, height, 1.0]) @ homography(controls.alignment.corners)
        return {
            "display": (float(width), float(height)),
            "flips": self._flips(controls),
            "picture_from_wall": np.linalg.inv(wall_from_picture),
        }

    def _light(self, scale: float) -> dict[str, Any]:
        """Brightness, gamma and edge blend, as far as the picture does not have them already."""
        if self._is_graded:
            return {}
        self._pictures += 1
        inputs: dict[str, Any] = {
            "scale": scale,
            "inverse_gamma": 1.0 / self._config.gamma,
            "seed": (self._pictures % 64 * _DITHER_STEP, self._pictures % 61 * _DITHER_STEP),
        }
        blend = self._config.edge_blend
        if blend is not None:
            inputs["blend"] = (-1.0 if blend.part == "left" else 1.0, blend.overlap, 1.0 / blend.gamma)
        return inputs

    def _mark(self, lines: tuple[str, ...], display: Size, controls: Controls) -> dict[str, Any]:
        """Grid, chosen corner, figures and numbers."""
        text_scale = max(1, display[1] // _TEXT_ROWS)
        corners = controls.alignment.corners if controls.shows_grid else None
        written = (display, lines, corners)
        if written != self._written:
            blend = self._config.edge_blend
            size = -(-display[0] // text_scale), -(-display[1] // text_scale)
            image = page(size, lines, corners, "" if blend is None else f"{blend.part} part")
            self._text.release()
            self._text = self._gl.texture((image.shape[1], image.shape[0]), 1, image.tobytes(), alignment=1)
            self._text.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._written = written
        width, height = picture_size(self._config, display)
        x, y = controls.alignment.corners[controls.corner or 0]
        radius = 0.0 if controls.corner is None else _MARKER_RADIUS
        return {
            "text": self._text,
            "text_scale": float(text_scale),
            "aspect": width / height,
            "grid": float(controls.shows_grid),
            "marker": (x * display[0], y * display[1], radius),
        }

    def _target(self, size: Size) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        texture = self._gl.texture(size, 4)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        return texture, self._gl.framebuffer([texture])

    def _release_picture(self) -> None:
        self.picture.release()
        self._texture.release()
