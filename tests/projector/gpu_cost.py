"""What pictures cost the GPU, measured: draw calls, memory, and time as a multiple of a known pass."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import moderngl

MAKERS = "texture", "buffer", "renderbuffer", "depth_renderbuffer"
BYTES = {"f1": 1, "f2": 2, "f4": 4}
RUNS, MOST_RUNS = 2, 12  # of each measured time: the shortest counts
SAMPLES = 8  # of the known pass, for each pixel
_HEAD = "#version 300 es\nprecision highp float;\nprecision highp sampler2D;\n"
_VERTEX = (
    _HEAD + "void main() { gl_Position = vec4(gl_VertexID % 2 * 4 - 1, gl_VertexID / 2 * 4 - 1, 0, 1); }"
)
_FRAGMENT = f"""{_HEAD}
uniform sampler2D source;
out vec4 colour;
void main() {{
    vec4 sum = vec4(0);
    for (int i = 0; i < {SAMPLES}; i++)
        sum += float(i) * texture(source, gl_FragCoord.xy / 512.0 + 0.01 * float(i));
    colour = sum / 28.0;
}}"""


class GpuCost:
    """Notes what is made on the GPU, and each draw call."""

    def __init__(self) -> None:
        self.draw_calls = 0
        self._made: list[Any] = []

    @contextmanager
    def watching(self) -> Iterator[None]:
        makers = {name: self._noted(getattr(moderngl.Context, name)) for name in MAKERS}
        render = moderngl.VertexArray.render

        def counted(*args: Any, **kwargs: Any) -> None:
            self.draw_calls += 1
            render(*args, **kwargs)

        with (
            patch.multiple(moderngl.Context, **makers),
            patch.object(moderngl.VertexArray, "render", counted),
        ):
            yield

    @property
    def memory_bytes(self) -> int:
        """Memory of what was made and is not released; mipmaps are not counted."""
        return sum(_bytes(one) for one in self._made if not isinstance(one.mglo, moderngl.InvalidObject))

    def _noted(self, make: Callable[..., Any]) -> Callable[..., Any]:
        def made(*args: Any, **kwargs: Any) -> Any:
            self._made.append(make(*args, **kwargs))
            return self._made[-1]

        return made


def _bytes(made: Any) -> int:
    if isinstance(made, moderngl.Buffer):
        return made.size
    each = 4 if made.depth else made.components * BYTES[made.dtype]
    return made.width * made.height * each * max(1, made.samples)


def passes(gl: moderngl.Context, size: tuple[int, int], draw: Callable[[], None], most: float) -> float:
    """The GPU's time for `draw`, as a multiple of its time for a pass of SAMPLES samples for each pixel.

    Each time is the least of several turns; of more, as long as it is above `most`: the machine may be busy.
    """
    target = gl.framebuffer([gl.texture(size, 4)])
    source = gl.texture((512, 512), 4, bytes(range(256)) * 4096)
    triangle = gl.vertex_array(gl.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT), [])

    def known_pass() -> None:
        target.use()
        gl.enable_only(moderngl.NOTHING)
        source.use(0)
        triangle.render(moderngl.TRIANGLES, 3)

    timer, took_ns = gl.query(time=True), {draw: 0, known_pass: 0}
    for run in range(1 + MOST_RUNS):
        if run > RUNS and took_ns[draw] < most * took_ns[known_pass]:
            break
        for measured in took_ns:
            with timer:
                measured()
            if run:  # drivers defer work to the first
                took_ns[measured] = min(took_ns[measured] or timer.elapsed, timer.elapsed)
    for owned in (*target.color_attachments, target, source, triangle):
        owned.release()
    return took_ns[draw] / took_ns[known_pass]
