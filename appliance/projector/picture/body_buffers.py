"""The body's surface on the GPU: fine for the eye, coarse for shadows, in between for a molten figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from appliance.body.bake import bake, cells
from appliance.body.skinning import BodyMesh
from appliance.projector.picture.vertices import layout, packed

# Shares of the figure's height: vertices closer than this are merged for shadows, and for a molten figure.
COARSE, MOLTEN = 0.02, 0.007

Floats = NDArray[np.float32]
Content = tuple[list[tuple[Any, ...]], moderngl.Buffer]
PARTS = ("position", "normal", "sunk", "calm", "joints", "weights")


class BodyBuffers:
    """The surface in figure heights, rest pose; content and molten are what vertex arrays are made of.

    positions, normals: (V, 3); joints, weights: (V, 4); faces: (F, 3). Light, molten details and the drawing
    order are the show's; they are computed here, in a third of a second, where it has no surface.
    """

    def __init__(self, ctx: moderngl.Context, mesh: BodyMesh, melts: bool = False) -> None:
        self.positions = (mesh.vertices / mesh.height).astype(np.float32)
        self.normals, self.joints, self.weights = mesh.normals, mesh.joints, mesh.weights
        self.faces = mesh.faces
        baked = mesh.baked or bake(mesh)
        lit = np.concatenate([self.normals, baked.open[:, None]], axis=1)
        values = self.positions, lit, baked.sunk, baked.calm, self.joints, self.weights
        parts = dict(zip(PARTS, values, strict=True))
        self._layout = layout(parts)
        drawn = mesh.faces[baked.order]
        self._fine = _uploaded(ctx, parts, np.arange(len(self.positions)), drawn)
        self._coarse = _uploaded(ctx, parts, *merged(self.positions, drawn, COARSE))
        self._molten = _uploaded(ctx, parts, *merged(self.positions, drawn, MOLTEN)) if melts else ()

    def content(self, coarse: bool) -> Content:
        """The vertices with their layout, and the indices."""
        vertices, indices = self._coarse if coarse else self._fine
        return [(vertices, *self._layout)], indices

    @property
    def molten(self) -> Content | None:
        """The same for a figure whose details have melted, in a show where some look melts."""
        return ([(self._molten[0], *self._layout)], self._molten[1]) if self._molten else None

    def release(self) -> None:
        for buffer in (*self._fine, *self._coarse, *self._molten):
            buffer.release()


def _uploaded(
    ctx: moderngl.Context, parts: Mapping[str, Any], chosen: NDArray[np.int64], faces: NDArray[np.int32]
) -> tuple[moderngl.Buffer, moderngl.Buffer]:
    """The chosen vertices and the faces (F, 3) between them. Vertices are in the order in which faces come to
    them: a GPU then moves each once and not twice."""
    first_use = np.full(len(chosen), faces.size)
    np.minimum.at(first_use, faces.reshape(-1), np.arange(faces.size))
    order = np.argsort(first_use)[: np.count_nonzero(first_use < faces.size)]
    number = np.zeros(len(chosen), np.int32)
    number[order] = np.arange(len(order))
    vertices = packed({name: values[chosen[order]] for name, values in parts.items()})
    return ctx.buffer(vertices), ctx.buffer(number[faces].tobytes())


def merged(
    positions: Floats, faces: NDArray[np.int32], size: float
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """One vertex for all in a cell of space: which vertices stay, and the faces between those that stay."""
    first, cell = cells(positions, size)
    corners = cell[faces]
    a, b, c = corners.T
    return first, corners[(a != b) & (b != c) & (c != a)].astype(np.int32)
