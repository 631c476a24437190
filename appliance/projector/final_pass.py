"""The last step of each picture: from the drawn scene onto the wall, through corner-pin and levels."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
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
_COARSE_WIDE = Detail(0.64, 0)  # in place of 0.7: a picture twice as large within 25 MB of graphics memory
_DITHER_STEP = 0.618034  # pixels: no two neighbouring pictures have the same pattern
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
_CLIP_FROM_DISPLAY = np.array([[2.0, 0.0, -1.0], [0.0, -2.0, 1.0], [0.0, 0.0, 1.0]])  # y down


@dataclass(frozen=True)
class Part:
    """The part of the picture that this display shows, as fractions of the whole; y down."""

    left: float
    top: float
    width: float
    height: float


_TOWARDS = {
    "left": (1.0, 0.0),
    "right": (-1.0, 0.0),
    "top": (0.0, 1.0),
    "bottom": (0.0, -1.0),
}  # the other part


def part_of(blend: EdgeBlendConfig | None, overlap: float) -> Part:
    """The whole picture without edge blend; else one side of it. overlap: a fraction of this display."""
    if blend is None:
        return Part(0.0, 0.0, 1.0, 1.0)
    share = 1.0 / (2.0 - overlap)
    at = 1.0 - share if blend.part in ("right", "bottom") else 0.0
    across = blend.part in ("left", "right")
    return Part(at, 0.0, share, 1.0) if across else Part(0.0, at, 1.0, share)


def picture_size(config: ProjectorConfig, display: Size, overlap: float, share: float = 1.0) -> Size:
    """Pixels that the scene is drawn in: a share of the display's unless the box file says otherwise, and
    with edge blend as many more as both displays show."""
    width, height = config.picture or (round(display[0] * share), round(display[1] * share))
    part = part_of(config.edge_blend, overlap)
    return max(1, round(width / part.width)), max(1, round(height / part.height))


class FinalPass:
    """Owns the picture's texture and the programs that lay it onto the wall, one of them with marks.

    Where no marks are shown, a look does most of it or all: `wall`. Edges are then blended on the display.
    """

    def __init__(self, gl: moderngl.Context, config: ProjectorConfig) -> None:
        self._gl, self._config = gl, config
        self._levels = (
            *("GAMMA",) * (config.gamma != 1.0),
            *("BLEND",) * (config.edge_blend is not None),
            "DIM",
        )
        self._drawings: dict[tuple[str, ...], Drawing] = {}
        self._is_graded = False  # whether the picture has its brightness and gamma already
        self._is_unblended = False  # whether a look's picture on the display still needs its edges
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
        whole = picture_size(self._config, display, controls.alignment.overlap)
        self._is_graded = not has_marks
        self._is_unblended = self._config.edge_blend is not None and not has_marks
        if self._config.edge_blend is not None and detail == DETAILS[0]:
            detail = _COARSE_WIDE
        if self._is_graded and size == whole and (self._config.picture or display) == display:
            self.resize(_NO_SIZE)
            clip_from_picture = self._clip_from_part(controls) @ self._part_from_picture(controls) @ _Y_UP
            return Wall(screen, display, size, clip_from_picture, scale, gamma, detail=detail, toe=toe)
        self.resize(size)
        if not self._is_graded:
            return replace(flat(self.picture), detail=detail, toe=toe)
        finer = 1.0 if self._config.picture else whole[1] / size[1]
        return Wall(self.picture, size, size, FLAT, scale, gamma, finer, detail, toe)

    def show_image(self, image: NDArray[np.uint8]) -> None:
        """An image (height, width, 3), top row first, in place of a look's picture; `draw` does the rest."""
        self._is_graded = self._is_unblended = False
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
            "part": astuple(self._part(controls)),
            **self._light(scale),
            **self._blend(controls),
        }
        if has_marks:
            inputs |= self._place(display, controls) | self._mark(lines, display, controls)
            if warp:
                inputs["offsets"] = self._fine_offsets(warp)
            self._drawing(*self._levels, "MARKS", *("WARP",) * bool(warp)).draw(inputs)
        else:
            inputs["clip_from_part"] = self._clip_from_part(controls)
            levels = () if self._is_graded else self._levels
            self._drawing(*levels).draw(inputs, moderngl.TRIANGLE_STRIP, 4)

    def darken(self, screen: moderngl.Framebuffer, display: Size, controls: Controls) -> None:
        """Blend the edges if a look laid its picture onto the display; darken what the box file's masks
        cover. The very last step of a picture."""
        if self._is_unblended:
            self._gl.enable_only(moderngl.BLEND)
            self._gl.blend_func = moderngl.ZERO, moderngl.SRC_COLOR
            screen.use()
            screen.viewport = (0, 0, *display)
            edges = self._drawing("MARKS", "BLEND", "EDGES")
            edges.draw(self._place(display, controls) | self._blend(controls))
        self._masks.draw(screen, display, self._flips(controls), controls.shows_grid)

    def black(self, screen: moderngl.Framebuffer, display: Size) -> None:
        """Clear the display: no picture, no figures, no marks."""
        screen.use()
        screen.viewport = (0, 0, *display)
        screen.clear(0.0, 0.0, 0.0, 0.0)

    def release(self) -> None:
        """Give the GPU's memory back."""
        self._release_picture()
        owned: tuple[Any, ...] = self._masks, self._text, self._offsets, *self._drawings.values()
        for one in owned:
            one.release()

    def _drawing(self, *parts: str) -> Drawing:
        """Made when it is first needed: a wall without marks needs one of them, or none."""
        if parts not in self._drawings:
            self._drawings[parts] = Drawing(self._gl, "final", "final", parts=parts)
        return self._drawings[parts]

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

    def _part(self, controls: Controls) -> Part:
        return part_of(self._config.edge_blend, controls.alignment.overlap)

    def _part_from_picture(self, controls: Controls) -> NDArray[np.float64]:
        """(3, 3) from the picture's unit square (y down) to that of this display's part."""
        part = self._part(controls)
        return np.array(
            [
                [1.0 / part.width, 0.0, -part.left / part.width],
                [0.0, 1.0 / part.height, -part.top / part.height],
                [0.0, 0.0, 1.0],
            ]
        )

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
        """Brightness and gamma, as far as the picture does not have them already."""
        if self._is_graded:
            return {}
        self._pictures += 1
        return {
            "scale": scale,
            "inverse_gamma": 1.0 / self._config.gamma,
            "seed": (self._pictures % 64 * _DITHER_STEP, self._pictures % 61 * _DITHER_STEP),
        }

    def _blend(self, controls: Controls) -> dict[str, Any]:
        """Which edge is blended, and how."""
        blend, alignment = self._config.edge_blend, controls.alignment
        if blend is None:
            return {}
        return {"blend": (*_TOWARDS[blend.part], alignment.overlap, 1.0 / alignment.blend_gamma)}

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
        width, height = picture_size(self._config, display, controls.alignment.overlap)
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
