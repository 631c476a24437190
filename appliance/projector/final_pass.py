"""The last step of each picture: from the drawn scene onto the wall, through corner-pin and levels."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources

import moderngl
import numpy as np

from appliance.projector.controls import Controls
from appliance.projector.corners import homography
from appliance.projector.info import letters
from appliance.projector.window import Size
from appliance.show.projector import EdgeBlendConfig, ProjectorConfig

_SHADERS = resources.files("appliance.projector") / "shaders"
_MARKER_RADIUS = 28.0  # pixels
_TEXT_ROWS = 160  # letters are as large as if the display had so many rows of pixels
_DITHER_STEP = 0.618034  # pixels: no two neighbouring pictures have the same pattern


@dataclass(frozen=True)
class Part:
    """What of the picture this display shows: where it begins and how wide it is, in shares of its width."""

    begin: float
    width: float


def part_of(blend: EdgeBlendConfig | None) -> Part:
    """The whole picture without edge blend; else one side of it."""
    if blend is None:
        return Part(0.0, 1.0)
    width = 1.0 / (2.0 - blend.overlap)
    return Part(0.0 if blend.part == "left" else 1.0 - width, width)


def picture_size(config: ProjectorConfig, display: Size) -> Size:
    """In what size the scene is drawn, pixels: the display's unless the box file says otherwise."""
    width, height = config.picture or display
    return round(width / part_of(config.edge_blend).width), height


class FinalPass:
    """Owns the picture's texture and the program that lays it onto the wall."""

    def __init__(self, gl: moderngl.Context, config: ProjectorConfig) -> None:
        self._gl, self._config = gl, config
        self._part = part_of(config.edge_blend)
        self._program = gl.program(
            vertex_shader=(_SHADERS / "final.vert.glsl").read_text(),
            fragment_shader=(_SHADERS / "final.frag.glsl").read_text(),
        )
        self._triangle = gl.vertex_array(self._program, [])
        self._text = gl.texture((1, 1), 1)
        self._lines: tuple[str, ...] = ()
        self._pictures = 0
        self._texture, self.picture = self._target((1, 1))

    def resize(self, size: Size) -> None:
        """The size in which the scene is drawn, pixels."""
        if self.picture.size != size:
            self._forget_picture()
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
        screen.use()
        screen.viewport = (0, 0, *display)
        self._gl.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._place(display, controls)
        self._light(level * controls.alignment.brightness)
        self._write(lines, display)
        self._set("grid", float(controls.shows_grid))
        self._texture.use(0)
        self._text.use(1)
        self._set("picture", 0)
        self._set("text", 1)
        self._triangle.render(vertices=3)

    def black(self, screen: moderngl.Framebuffer, display: Size) -> None:
        """Nothing at all, not even what was asked for."""
        screen.use()
        screen.viewport = (0, 0, *display)
        screen.clear(0.0, 0.0, 0.0, 0.0)

    def release(self) -> None:
        """Give the GPU's memory back."""
        self._forget_picture()
        for owned in (self._text, self._triangle, self._program):
            owned.release()

    def _place(self, display: Size, controls: Controls) -> None:
        width, height = display
        alignment, config = controls.alignment, self._config
        wall_from_picture = np.diag([width, height, 1.0]) @ homography(alignment.corners)
        picture_from_wall = np.linalg.inv(wall_from_picture)
        self._set("display", (float(width), float(height)))
        self._set("flips", (float(alignment.mirror != config.upside_down), float(config.upside_down)))
        self._set("picture_from_wall", tuple(picture_from_wall.T.ravel()))  # column by column
        self._set("part", (self._part.begin, self._part.width))
        marker = (0.0, 0.0, 0.0)
        if controls.corner is not None:
            x, y = alignment.corners[controls.corner]
            marker = (x * width, y * height, _MARKER_RADIUS)
        self._set("marker", marker)

    def _light(self, scale: float) -> None:
        blend, gamma = self._config.edge_blend, self._config.gamma
        side = 0.0 if blend is None else -1.0 if blend.part == "left" else 1.0
        self._set("blend", (side, blend.overlap, 1.0 / blend.gamma) if blend else (0.0, 1.0, 1.0))
        self._set("scale", scale)
        self._set("inverse_gamma", 1.0 / gamma)
        passes_unchanged = scale == 1.0 and gamma == 1.0 and blend is None
        self._set("dither", 0.0 if passes_unchanged else 1.0)
        self._pictures += 1
        self._set("seed", (self._pictures % 64 * _DITHER_STEP, self._pictures % 61 * _DITHER_STEP))

    def _write(self, lines: tuple[str, ...], display: Size) -> None:
        if lines != self._lines:
            image = letters(lines)
            self._text.release()
            self._text = self._gl.texture((image.shape[1], image.shape[0]), 1, image.tobytes(), alignment=1)
            self._text.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._lines = lines
        scale = float(max(1, display[1] // _TEXT_ROWS))
        size = self._text.size if lines else (0, 0)
        self._set("text_scale", scale)
        self._set("text_size", (scale * size[0], scale * size[1]))

    def _set(self, name: str, value: object) -> None:
        uniform = self._program[name]
        assert isinstance(uniform, moderngl.Uniform)
        uniform.value = value

    def _target(self, size: Size) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        texture = self._gl.texture(size, 4)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        return texture, self._gl.framebuffer([texture])

    def _forget_picture(self) -> None:
        self.picture.release()
        self._texture.release()
