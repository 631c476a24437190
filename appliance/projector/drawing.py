"""Drawing: a shader program with what it draws, counted so that the cost of a picture is known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl

_SHADERS = Path(__file__).parent / "shaders"
_HEAD = "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n"


@dataclass
class Tally:
    """What was drawn since it was last emptied; `pixels` weighs each by the work that its shader does."""

    draw_calls: int = 0
    triangles: int = 0
    vertices: int = 0
    pixels: float = 0.0


class Drawing:
    """One shader program and the vertices that it draws."""

    def __init__(
        self,
        ctx: moderngl.Context,
        vertex: str,
        fragment: str,
        content: Iterable[tuple[Any, ...]] = (),
        index: moderngl.Buffer | None = None,
    ) -> None:
        self._program = ctx.program(
            vertex_shader=_source(vertex + ".vert"), fragment_shader=_source(fragment + ".frag")
        )
        self._array = ctx.vertex_array(self._program, list(content), index, skip_errors=True)
        self._textures = [
            name
            for name in self._program
            if isinstance(self._program[name], moderngl.Uniform) and self._program[name].gl_type == 0x8B5E
        ]
        for unit, name in enumerate(self._textures):
            self._program[name].value = unit

    def draw(
        self,
        tally: Tally,
        mode: int = moderngl.TRIANGLES,
        vertices: int = -1,
        instances: int = 1,
        **inputs: Any,
    ) -> None:
        """Draw with uniforms and textures by name; names that the shader does without are ignored."""
        tally.draw_calls += 1
        for name, value in inputs.items():
            if isinstance(value, moderngl.Texture):
                if name in self._textures:
                    value.use(self._textures.index(name))
            elif name in self._program:
                uniform = self._program[name]
                if isinstance(value, (int, float)) or not hasattr(value, "tobytes"):
                    uniform.value = value
                else:
                    uniform.write(value.T.astype("f4").tobytes())  # OpenGL keeps matrices by column
        self._array.render(mode, vertices, instances=instances)

    def release(self) -> None:
        self._array.release()
        self._program.release()


def _source(name: str) -> str:
    return _HEAD + _resolved(name)


def _resolved(name: str) -> str:
    lines = (_SHADERS / f"{name}.glsl").read_text(encoding="utf-8").splitlines()
    return "\n".join(_resolved(line.split()[1]) if line.startswith("#include") else line for line in lines)
