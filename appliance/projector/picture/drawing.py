"""Drawing: a shader program with what it draws."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

MOLTEN = 0.55  # `melt` from which on all of a body is on its molten surface, as melt.glsl says
_SHADERS = Path(__file__).parents[1] / "shaders"
_HEAD = "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n"
_SAMPLER_2D = 0x8B5E  # OpenGL's name for the type of a texture in a shader


class Drawing:
    """One shader program and the vertices that it draws.

    vertex and fragment name files in the shaders' folder, without .vert.glsl and .frag.glsl; content and
    index are a vertex array's, molten those that take their place where a figure has melted; parts are
    switched on in both. Without content it draws the three corners of a triangle over the picture.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        vertex: str,
        fragment: str,
        content: Iterable[tuple[Any, ...]] = (),
        index: moderngl.Buffer | None = None,
        parts: Sequence[str] = (),
        molten: tuple[Iterable[tuple[Any, ...]], moderngl.Buffer] | None = None,
    ) -> None:
        content = list(content)
        self._count = index.size // 4 if index else 3
        head = _HEAD + "".join(f"#define {part}\n" for part in parts)
        self._program = ctx.program(
            vertex_shader=head + source(f"{vertex}.vert"), fragment_shader=head + source(f"{fragment}.frag")
        )
        self._array = ctx.vertex_array(self._program, content, index, skip_errors=True)
        self._molten = self._array, self._count
        if molten is not None:
            array = ctx.vertex_array(self._program, list(molten[0]), molten[1], skip_errors=True)
            self._molten = array, molten[1].size // 4
        members = {name: self._program[name] for name in self._program}
        self._uniforms = {
            name: member for name, member in members.items() if isinstance(member, moderngl.Uniform)
        }
        self._textures = [
            name for name, member in self._uniforms.items() if getattr(member, "gl_type", 0) == _SAMPLER_2D
        ]
        for unit, name in enumerate(self._textures):
            self._uniforms.pop(name).value = unit
        self._sent: dict[str, Any] = {}  # what each uniform holds: sending it again would waste time

    def draw(
        self, inputs: dict[str, Any], mode: int = moderngl.TRIANGLES, vertices: int = 0, instances: int = 1
    ) -> None:
        """Draw with textures and uniforms by name; the shader takes those that it knows.

        vertices: draw only the first of them. Matrices are numpy's, for column vectors.
        """
        for unit, name in enumerate(self._textures):
            inputs[name].use(unit)
        self._send(inputs)
        array, count = self._molten if inputs.get("melt", 0.0) >= MOLTEN else (self._array, self._count)
        array.render(mode, vertices or count, instances=instances)

    def _send(self, inputs: dict[str, Any]) -> None:
        """The uniforms that have changed."""
        for name, uniform in self._uniforms.items():
            value, sent = inputs[name], self._sent.get(name)
            if isinstance(value, np.ndarray):
                if value is not sent:
                    uniform.write(value.T.astype("f4").tobytes())
            elif value != sent:
                uniform.value = value
            self._sent[name] = value

    def release(self) -> None:
        if self._molten[0] is not self._array:
            self._molten[0].release()
        self._array.release()
        self._program.release()


def source(name: str) -> str:
    """A shader's text, with the files in place of its #include lines."""
    lines = (_SHADERS / f"{name}.glsl").read_text(encoding="utf-8").splitlines()
    return "\n".join(source(line.split()[1]) if line.startswith("#include") else line for line in lines)
