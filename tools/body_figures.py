"""Measures a dance: `python -m tools.body_figures JOURNAL [SHOW]`; a surface: the same with `body.npz`.

Dance: how often and how deep upper arms are in the trunk, how fast standing feet slide; beside the show's
phrase. Surface: triangles and their shape; in bends of the default show's skeleton, how much volume the bend
adds and how much of the skin near the joint is inside the body; beside linear blending of the same weights.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.body.mesh_file import unpacked
from appliance.body.skinning import BodyMesh, dual_quaternions
from appliance.cli.pictures import load_dance
from appliance.dancer.grounding import survey
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import default_show_path
from appliance.studio.evaluation.dance_figures import BodyFigures
from appliance.studio.standing import measure_standing

Vertices = NDArray[np.float32]
BENDS: dict[str, dict[str, tuple[tuple[int, int, int], float]]] = {  # joint: axis, degrees
    "elbow bent by 120": {"lForeArm": ((0, 1, 0), -120)},
    "forearm twisted by 90": {"lForeArm": ((1, 0, 0), 90)},
    "arm up": {"lShldr": ((0, 0, 1), 62), "lCollar": ((0, 0, 1), 22)},
    "arm down": {"lShldr": ((0, 0, 1), -72)},
    "thigh up, knee bent by 120": {"lThigh": ((1, 0, 0), -95), "lShin": ((1, 0, 0), 120)},
    "thigh to the side by 60": {"lThigh": ((0, 0, 1), 60)},
    "head back": {"head": ((1, 0, 0), -38), "neck": ((1, 0, 0), -22)},
    "trunk twisted by 60": {"abdomen": ((0, 1, 0), 25), "chest": ((0, 1, 0), 35)},
}
_NEAR = 0.14  # share of the height: the skin around a bent joint
_SAMPLES = 300


def skin(mesh: BodyMesh, positions: Array, world: Array, linear: bool = False) -> tuple[Vertices, Vertices]:
    """As shaders do it: vertices, normals (V, 3) for positions (J, 3), metres, world rotations (J, 4);
    linear: blend the moved places instead."""
    moves = dual_quaternions(mesh.bind_positions, mesh.bind_world, positions, world)
    moved_by = moves[mesh.joints]  # (V, 4, 8)
    if linear:
        weights = mesh.weights[..., None]
        shift = (
            2.0 * quaternion.multiply(moves[:, 4:], quaternion.inverse(moves[:, :4]))[mesh.joints][..., 1:]
        )
        places = quaternion.rotate(moved_by[..., :4], mesh.vertices[:, None]) + shift
        normals = quaternion.rotate(moved_by[..., :4], mesh.normals[:, None])
        return (weights * places).sum(axis=1), (weights * normals).sum(axis=1)
    agrees = np.sum(moved_by[..., :4] * moved_by[:, :1, :4], axis=-1) >= 0.0
    blended = np.einsum("vk,vkc->vc", np.where(agrees, mesh.weights, -mesh.weights), moved_by)
    blended /= np.linalg.norm(blended[:, :4], axis=1, keepdims=True)
    turn, dual = blended[:, :4], blended[:, 4:]
    shift = 2.0 * quaternion.multiply(dual, quaternion.inverse(turn))[:, 1:]
    vertices = quaternion.rotate(turn, mesh.vertices) + shift
    return vertices.astype(np.float32), quaternion.rotate(turn, mesh.normals).astype(np.float32)


def volume(vertices: Vertices, faces: NDArray[np.int32]) -> float:
    """Cubic metres inside, positive where the faces look outwards."""
    a, b, c = vertices[faces].astype(float).transpose(1, 0, 2)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def print_surface(file: Path) -> None:
    """Print triangles and bends of the surface in a `body.npz` for the default show's skeleton."""
    skeleton = read_bvh(default_show_path() / "phrase.bvh").skeleton
    with np.load(file, allow_pickle=False) as arrays:
        mesh = unpacked(dict(arrays), len(skeleton))
    if mesh is None:
        sys.exit(f"{file} is not the surface of the default show's skeleton.")
    corners = mesh.vertices[mesh.faces].astype(float)
    edges = np.roll(corners, -1, axis=1) - corners
    area = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    shape = 4 * np.sqrt(3) * area / np.maximum((edges**2).sum(axis=(1, 2)), 1e-12)
    print(
        f"{len(mesh.faces)} triangles, shape (1: equilateral) {shape.mean():.2f} on average, "
        f"{np.percentile(shape, 5):.2f} at the 5th percentile; "
        f"{1000 * volume(mesh.vertices, mesh.faces):.1f} litres"
    )
    for name, bend in BENDS.items():
        figures = [_bent(mesh, skeleton, bend, linear) for linear in (False, True)]
        (kept, inside), (kept_linear, inside_linear) = figures
        print(
            f"{name}: volume {1e6 * kept:+.0f} ml, {100 * inside:.1f} % of the skin inside; "
            f"linear {1e6 * kept_linear:+.0f} ml, {100 * inside_linear:.1f} %"
        )


def _bent(
    mesh: BodyMesh, skeleton: Skeleton, bend: dict[str, tuple[tuple[int, int, int], float]], linear: bool
) -> tuple[float, float]:
    """Cubic metres gained, and the share of the skin near the bent joints that is inside the body."""
    pose = np.tile(quaternion.IDENTITY.astype(float), (len(skeleton), 1))
    for name, (axis, degrees) in bend.items():
        pose[skeleton.index(name)] = quaternion.from_axis_angle(axis, np.radians(degrees))
    positions, world = skeleton.forward_kinematics(pose, np.zeros(3))
    vertices, normals = skin(mesh, positions, world, linear)
    joints = mesh.bind_positions[[skeleton.index(name) for name in bend]]
    near = np.linalg.norm(mesh.vertices[:, None] - joints, axis=2).min(axis=1) < _NEAR * mesh.height
    chosen = np.flatnonzero(near)[:: max(1, int(near.sum()) // _SAMPLES)]
    points = vertices[chosen] + 0.001 * normals[chosen]
    inside = np.mean([_winding(point, vertices[mesh.faces]) > 0.5 for point in points])
    return volume(vertices, mesh.faces) - volume(mesh.vertices, mesh.faces), float(inside)


def _winding(point: Vertices, corners: Vertices) -> float:
    """How often a surface (F, 3, 3) winds around a point (3,) (van Oosterom and Strackee 1983)."""
    a, b, c = (corners[:, i] - point for i in range(3))
    la, lb, lc = (np.sqrt(np.einsum("fi,fi->f", v, v)) for v in (a, b, c))
    above = np.einsum("fi,fi->f", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("fi,fi->f", v, w) for v, w in ((a, b), (b, c), (c, a)))
    below = la * lb * lc + ab * lc + bc * la + ca * lb
    return float(np.arctan2(above, below).sum() / (2 * np.pi))


def print_figures(journal: Path, show: Path) -> None:
    """A line for the phrase, and one for what was danced."""
    phrase = read_bvh(show / "phrase.bvh")
    floor = survey(phrase)

    def row(name: str, dance: Recording) -> None:
        body = BodyFigures(dance)
        slide = measure_standing(dance.skeleton, dance.poses, dance.roots, floor).slide_cm_s / 100
        arms = body.arms(dance.poses)
        print(
            f"{name}: {len(dance)} poses, an upper arm deep in the trunk in {100 * arms.arm_in_trunk:.2f} %, "
            f"99 % at most {arms.arm_depth_cm:.1f} cm; feet slide at {slide:.3f} m/s"
        )

    row("phrase", phrase)
    row("danced", load_dance(journal).of_puppet(None))


if __name__ == "__main__":
    if sys.argv[1].endswith(".npz"):
        print_surface(Path(sys.argv[1]))
        sys.exit()
    print_figures(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else default_show_path())
