"""docs/pictures/wearing.png, by `python -m tools.wearing_picture`: neutral pose, sensor and its arrow."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from appliance.pictures.figure import Frame, render
from appliance.pose import quaternion
from appliance.pose.body import Body
from appliance.pose.bvh import read_bvh
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

SKELETON = Path(__file__).resolve().parents[1] / "appliance" / "show" / "default_show" / "skeleton.bvh"
PICTURE = Path("docs/pictures/wearing.png")
WIDTH, HEIGHT = 1200, 680
BACKDROP, INK, FAINT = "#0f1015", "#efe6d8", "#9a948c"
IVORY, VERMILION = np.array([0.93, 0.87, 0.78]), np.array([0.96, 0.27, 0.13])
STRAP, LID, SIDES = "#20232c", "#3b4252", ("#2a303d", "#222733", "#181c25")
AZIMUTH, ELEVATION = np.radians(48), np.radians(16)
HANG = np.radians(80)  # the arms, from the T of the rest pose
FRONT, LEFT, UP = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
HALF_CASE_M = np.array([0.009, 0.020, 0.027])  # out of the lid, along the arm, along the arrow


def main() -> None:
    """Draw the picture, or another file that is named."""
    print(draw_wearing(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE))


def draw_wearing(path: Path) -> Path:
    """The dancer in the neutral pose, and the sensor on the left wrist from near."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    dancer = _Dancer(read_bvh(SKELETON).skeleton)
    figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100, facecolor=BACKDROP)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(HEIGHT, 0)
    far = _View((270, 316), 310.0, dancer.middle)
    near = _View((850, 356), 1750.0, dancer.wrist)
    circle = Circle(near.at, 250, facecolor="#191b23", edgecolor=FAINT, linewidth=1.2, zorder=4)
    axes.add_patch(circle)
    for view, size, clip in ((far, (460, 640), None), (near, (520, 520), circle)):
        dancer.draw(axes, view, size, clip)
        dancer.draw_case(axes, view, clip)
    dancer.draw_arrow(axes, near)
    _point_out(axes, far.pixel(dancer.case), near)
    _write(axes, far, near, dancer)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, facecolor=BACKDROP)
    return path


@dataclass(frozen=True)
class _View:
    """Seen from the dancer's front left, a little from above: world point `focus` is at pixel `at`."""

    at: tuple[float, float]
    pixels_per_metre: float
    focus: Array

    def turned(self, points: Array) -> Array:
        """Right, up and towards the viewer, metres from the focus, (..., 3)."""
        (c, s), (e, f) = (np.cos(AZIMUTH), np.sin(AZIMUTH)), (np.cos(ELEVATION), np.sin(ELEVATION))
        turn = np.array([[1, 0, 0], [0, e, -f], [0, f, e]]) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        return np.asarray((np.asarray(points) - self.focus) @ turn.T)

    def pixel(self, points: Array) -> Array:
        """Where world points (..., 3) are in the picture, (..., 2)."""
        return np.array(self.at) + self.turned(points)[..., :2] * [1, -1] * self.pixels_per_metre


class _Dancer:
    """A figure with hanging arms, and the case on the outside of its left wrist."""

    def __init__(self, skeleton: Skeleton) -> None:
        pose = np.tile(quaternion.IDENTITY.astype(float), (len(skeleton), 1))
        for joint, way in (("lShldr", -1.0), ("rShldr", 1.0)):
            pose[skeleton.index(joint)] = quaternion.from_axis_angle(FRONT, way * HANG)
        positions, world = skeleton.forward_kinematics(pose, np.zeros(3))
        self.cones = Body(skeleton).cones(positions, world)
        forearm = skeleton.index("lForeArm")
        self.in_sight = np.isin(self.cones.joint, range(forearm, forearm + 12))  # and the hand below it
        self.middle = positions[skeleton.index("hip")]
        elbow, hand = positions[skeleton.index("lForeArm")], positions[skeleton.index("lHand")]
        self.wrist = elbow + 0.86 * (hand - elbow)
        self.along = (hand - elbow) / np.linalg.norm(hand - elbow)
        self.arrow = _unit(FRONT - (FRONT @ self.along) * self.along)
        self.out = np.cross(self.along, self.arrow)
        self.out *= np.sign(self.out @ LEFT)
        self.case = self.wrist + 0.031 * self.out

    def draw(self, axes: Any, view: _View, size: tuple[int, int], clip: Any) -> None:
        """The figure in a tile of `size` pixels around the view's middle."""
        width, height = size
        frame = Frame(width, height, width / 2, height / 2, view.pixels_per_metre)
        shown = self.in_sight if clip else np.full(len(self.cones.joint), True)
        cones = replace(
            self.cones,
            start=view.turned(self.cones.start[shown]),
            end=view.turned(self.cones.end[shown]),
            start_radius=self.cones.start_radius[shown],
            end_radius=self.cones.end_radius[shown],
            joint=self.cones.joint[shown],
        )
        picture = render(cones, np.tile(IVORY, (len(cones.joint), 1)), frame)
        picture[..., :3] /= np.maximum(picture[..., 3:], 1e-6)
        (x, y), zorder = view.at, 5 if clip else 2
        place = (x - width / 2, x + width / 2, y + height / 2, y - height / 2)
        image = axes.imshow(np.clip(picture, 0, 1), extent=place, aspect="auto", zorder=zorder)
        if clip:
            image.set_clip_path(clip)

    def draw_case(self, axes: Any, view: _View, clip: Any) -> None:
        """The strap and the three sides of the case that are seen."""
        from matplotlib.patches import Polygon

        zorder = 6 if clip else 3
        ring = np.linspace(0, np.pi, 40)[:, None]
        around = self.wrist + 0.0255 * (np.sin(ring) * self._towards_viewer() + np.cos(ring) * self._across())
        edges = [view.pixel(around + side * 0.011 * self.along) for side in (-1.0, 1.0)]
        band = Polygon(
            np.vstack([edges[0], edges[1][::-1]]), facecolor=STRAP, edgecolor="none", zorder=zorder
        )
        sides = [(self.along, 1, STRAP), (self.arrow, 2, STRAP), (self.out, 0, LID)]
        patches = [band]
        basis = np.stack([self.out, self.along, self.arrow])
        for number, (normal, axis, colour) in enumerate(sides):
            first, second = (k for k in range(3) if k != axis)
            towards = 1.0 if view.turned(view.focus + normal)[2] > 0 else -1.0
            centre = self.case + towards * HALF_CASE_M[axis] * normal
            a, b = HALF_CASE_M[first] * basis[first], HALF_CASE_M[second] * basis[second]
            corners = view.pixel(np.array([centre + a + b, centre + a - b, centre - a - b, centre - a + b]))
            face = colour if normal is self.out else SIDES[number]
            patches.append(
                Polygon(corners, facecolor=face, edgecolor="#59627a", linewidth=0.8, zorder=zorder)
            )
        for patch in patches:
            axes.add_patch(patch)
            if clip:
                patch.set_clip_path(clip)

    def draw_arrow(self, axes: Any, view: _View) -> None:
        """The arrow on the lid, and the way to the front that it shows."""
        from matplotlib.patches import Polygon

        lid = self.case + HALF_CASE_M[0] * self.out
        shape = np.array(
            [[-0.72, 0.1], [0.1, 0.1], [0.1, 0.34], [0.78, 0], [0.1, -0.34], [0.1, -0.1], [-0.72, -0.1]]
        )
        points = lid + shape[:, :1] * HALF_CASE_M[2] * self.arrow + shape[:, 1:] * HALF_CASE_M[1] * self.along
        axes.add_patch(Polygon(view.pixel(points), facecolor=VERMILION, edgecolor="none", zorder=7))

    def _towards_viewer(self) -> Array:
        viewer = LEFT * np.sin(AZIMUTH) + FRONT * np.cos(AZIMUTH)
        return _unit(viewer - (viewer @ self.along) * self.along)

    def _across(self) -> Array:
        return np.asarray(np.cross(self.along, self._towards_viewer()))


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


def _point_out(axes: Any, small: Array, near: _View) -> None:
    """Two lines from the small sensor to the circle."""
    from matplotlib.patches import Circle

    axes.add_patch(Circle(tuple(small), 22, fill=False, edgecolor=FAINT, linewidth=1.2, zorder=3))
    for way in (-1.0, 1.0):
        x, y = [small[0] + 4, near.at[0] - 40], [small[1] + 21.6 * way, near.at[1] + 246.8 * way]
        axes.plot(x, y, color=FAINT, linewidth=0.8, alpha=0.5, zorder=1)


def _write(axes: Any, far: _View, near: _View, dancer: _Dancer) -> None:
    """Words, and the arrow that says where the front is."""
    middle = {"ha": "center", "va": "center"}
    axes.text(far.at[0], 52, "The neutral pose", color=INK, fontsize=20, **middle)
    axes.text(near.at[0], 52, "The sensor on the left wrist", color=INK, fontsize=20, **middle)
    feet = np.array([0.0, -0.80, 0.12]) + dancer.middle * [1, 0, 1]
    start, end = far.pixel(feet + 0.10 * FRONT), far.pixel(feet + 0.46 * FRONT)
    style = {"arrowstyle": "-|>,head_length=0.7,head_width=0.35", "color": VERMILION, "linewidth": 3}
    axes.annotate("", xy=end, xytext=start, arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=1)
    axes.text(*np.add(end, (-8, 22)), "front", color=VERMILION, fontsize=13, **middle)
    tip, tail = (near.pixel(dancer.case + way * dancer.arrow) for way in (0.105, 0.042))
    axes.annotate("", xy=tip, xytext=tail, arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=8)
    axes.text(*np.add(tip, (-34, 0)), "front", color=VERMILION, fontsize=13, zorder=8, **middle)


if __name__ == "__main__":
    main()
