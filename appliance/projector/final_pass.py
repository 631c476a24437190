"""The last step of each picture: from the drawn scene onto the wall, through corner-pin and levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

import moderngl
import numpy as np

from appliance.projector.controls import Controls
from appliance.projector.corners import WHOLE, homography
from appliance.projector.page import page
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
    """Owns the picture's texture and the programs that lay it onto the wall, one of them with marks."""

    def __init__(self, gl: moderngl.Context, config: ProjectorConfig) -> None:
        self._gl, self._config = gl, config
        self._part = part_of(config.edge_blend)
        fixed = ["GAMMA"] * (config.gamma != 1.0) + ["BLEND"] * (config.edge_blend is not None)
        self._leaves_unchanged = not fixed and not config.upside_down
        self._through = _Program(gl, "through", [])
        self._plain, self._marked = (_Program(gl, "final", [*fixed, *marks]) for marks in ((), ("MARKS",)))
        self._text = gl.texture((1, 1), 1)
        self._written: tuple[object, ...] = ()
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
        scale = level * controls.alignment.brightness
        has_marks = bool(lines) or controls.shows_grid
        if scale == 0.0 and not has_marks:
            self.black(screen, display)
            return
        screen.use()
        screen.viewport = (0, 0, *display)
        is_whole = controls.alignment.corners == WHOLE and not controls.alignment.mirror
        is_same = is_whole and scale == 1.0 and self._leaves_unchanged and self.picture.size == display
        self._gl.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        if is_same and not has_marks:
            self._through.draw(self._texture)
            return
        program = self._marked if has_marks else self._plain
        self._place(program, display, controls)
        self._light(program, scale)
        if has_marks:
            self._mark(program, lines, display, controls)
        program.draw(self._texture)

    def black(self, screen: moderngl.Framebuffer, display: Size) -> None:
        """Nothing at all, not even what was asked for."""
        screen.use()
        screen.viewport = (0, 0, *display)
        screen.clear(0.0, 0.0, 0.0, 0.0)

    def release(self) -> None:
        """Give the GPU's memory back."""
        self._forget_picture()
        for owned in (self._text, self._through, self._plain, self._marked):
            owned.release()

    def _place(self, program: _Program, display: Size, controls: Controls) -> None:
        width, height = display
        alignment, upside_down = controls.alignment, self._config.upside_down
        wall_from_picture = np.diag([width, height, 1.0]) @ homography(alignment.corners)
        picture_from_wall = np.linalg.inv(wall_from_picture)
        program.set("display", (float(width), float(height)))
        program.set("flips", (float(alignment.mirror != upside_down), float(upside_down)))
        program.set("picture_from_wall", tuple(picture_from_wall.T.ravel()))  # column by column
        program.set("part", (self._part.begin, self._part.width))

    def _light(self, program: _Program, scale: float) -> None:
        blend = self._config.edge_blend
        if blend is not None:
            side = -1.0 if blend.part == "left" else 1.0
            program.set("blend", (side, blend.overlap, 1.0 / blend.gamma))
        if self._config.gamma != 1.0:
            program.set("inverse_gamma", 1.0 / self._config.gamma)
        program.set("scale", scale)
        program.set("dither", 0.0 if scale == 1.0 and self._leaves_unchanged else 1.0)
        self._pictures += 1
        program.set("seed", (self._pictures % 64 * _DITHER_STEP, self._pictures % 61 * _DITHER_STEP))

    def _mark(self, program: _Program, lines: tuple[str, ...], display: Size, controls: Controls) -> None:
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
        self._text.use(1)
        width, height = picture_size(self._config, display)
        x, y = controls.alignment.corners[controls.corner or 0]
        radius = 0.0 if controls.corner is None else _MARKER_RADIUS
        program.set("text", 1)
        program.set("text_scale", float(text_scale))
        program.set("aspect", width / height)
        program.set("grid", float(controls.shows_grid))
        program.set("marker", (x * display[0], y * display[1], radius))

    def _target(self, size: Size) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        texture = self._gl.texture(size, 4)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        return texture, self._gl.framebuffer([texture])

    def _forget_picture(self) -> None:
        self.picture.release()
        self._texture.release()


class _Program:
    """A final shader with some of its parts: what is not asked for would cost time on a small computer."""

    def __init__(self, gl: moderngl.Context, name: str, parts: Sequence[str]) -> None:
        version, _, source = (_SHADERS / f"{name}.frag.glsl").read_text().partition("\n")
        defines = "".join(f"#define {part}\n" for part in parts)
        self._program = gl.program(
            vertex_shader=(_SHADERS / "final.vert.glsl").read_text(),
            fragment_shader=f"{version}\n{defines}{source}",
        )
        self._triangle = gl.vertex_array(self._program, [])

    def set(self, name: str, value: object) -> None:
        """The value of a uniform."""
        uniform = self._program[name]
        assert isinstance(uniform, moderngl.Uniform)
        uniform.value = value

    def draw(self, picture: moderngl.Texture) -> None:
        """Cover the whole display."""
        picture.use(0)
        self._triangle.render(vertices=3)

    def release(self) -> None:
        self._triangle.release()
        self._program.release()
