"""A dancer by points that a camera program tracks, fitted to this figure as they come."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

from appliance.pose.point_axes import PointAxes
from appliance.pose.point_fit import TRUNK, PointFit
from appliance.pose.point_layouts import BY_COUNT, LAYOUTS
from appliance.pose.skeleton import Skeleton
from appliance.pose.turns import Quaternion, Vector
from appliance.show_control.figure_pose import HIPS, FigurePose

_FARTHEST = 1e5  # coordinate of a point, in any unit: 100 m in millimetres
_SILENT_S = 2.0  # after which a stream is a new one: its axes and its size are found anew
_LEAST_S = 0.0035  # between two frames: 250 a second, and a flood costs no more
_SIZED_FRAMES = 100  # in which the size is found
_CENTRED = 0.02  # fraction of the figure's size: hips that stay nearer than this are the program's origin


class PointsInput:
    """Points of one layout; `known` are the bones of this figure that the newest ones say."""

    def __init__(self, skeleton: Skeleton, figure: FigurePose, name: str) -> None:
        self.layout = LAYOUTS[name]
        self.known: frozenset[str] = frozenset()
        self._figure, self._fit = figure, PointFit(skeleton)
        self._came_at = -math.inf
        self._begin()

    def hear(self, numbers: Sequence[float], now: float) -> tuple[Vector, list[float]] | None:
        """x, y, z for each point of the layout, in any unit; a point that is not seen is not numbers, or 0,
        0, 0. Gives the hips' place in metres and all joints' w, x, y, z, not numbers where nothing says how
        a joint turns; None: it comes too soon after the one before. Raises ValueError with one sentence.
        """
        if 0.0 <= now - self._came_at < _LEAST_S:
            return None
        if now - self._came_at > _SILENT_S:
            self._begin()
        points: dict[str, Vector] = {}
        for part, x, y, z in zip(self.layout.parts, numbers[::3], numbers[1::3], numbers[2::3], strict=True):
            if part and (x or y or z) and max(abs(x), abs(y), abs(z)) < _FARTHEST:  # false for NaN
                points[part] = x, y, z
        if missing := [part for part in TRUNK if part not in points]:
            raise ValueError(self._refusal(f"not seen: {', '.join(missing)}"))
        points = self._axes.turned(points, now)
        try:
            turns = self._fit.turns(points)
        except ValueError as error:
            raise ValueError(self._refusal(str(error))) from None
        self._came_at = now
        self.known = self._figure.known(turns)
        return self._root(points, turns), self._figure.rotations(turns, self.known)

    def _root(self, points: dict[str, Vector], turns: dict[str, Quaternion]) -> Vector:
        """Where the hips are. Where the program counts from them, as high as the legs carry them."""
        if len(self._sizes) < _SIZED_FRAMES and (size := self._fit.scale(points)):
            self._sizes.append(size)
            self._scale = median(self._sizes)
        x, y, z = self._fit.root(points, turns[HIPS], self._scale)
        middle = self._fit.root(points, turns[HIPS], 0.0)
        self._is_centred &= math.dist((x, y, z), middle) < _CENTRED
        if not self._is_centred:
            return x, y, z
        height = self._fit.height(turns)
        return (math.nan,) * 3 if height is None else (0.0, height, 0.0)

    def _begin(self) -> None:
        self._fit.begin()
        self._axes = PointAxes(self.layout.is_y_down)
        self._sizes: list[float] = []
        self._scale, self._is_centred = 1.0, True

    def _refusal(self, what: str) -> str:
        return (
            f"{self.layout.program}'s {len(self.layout.parts)} points, {what}: the figure does not follow. "
            "Let the camera see hips and shoulders."
        )


def layout_named(name: str, count: int) -> str:
    """The layout of a message: by the name that it brings, else by how many points it has. Raises ValueError
    with one clear sentence.
    """
    if name:
        layout = LAYOUTS.get(name.casefold())
        if layout is None:
            raise ValueError(f"No layout of points is called {name[:32]!r}. There are {', '.join(LAYOUTS)}.")
        if len(layout.parts) != count:
            raise ValueError(f"{layout.program} has {len(layout.parts)} points, and {count} came.")
        return name.casefold()
    return BY_COUNT.get(count, "")
