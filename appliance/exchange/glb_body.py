"""A body from another program: a skinned figure in binary glTF or VRM, fitted to a show's skeleton."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.body.mesh_file import write_mesh
from appliance.body.rest_pose import anatomy_of
from appliance.body.skinning import MOVERS, BodyMesh, JointNumbers, joint_numbers
from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_file import GlbFile
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.roles import missing_roles, places_of, roles_of
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import shortest_turn

BODY_FILE = "body.glb"
MOST_TRIANGLES = 60_000
_TRIANGLES = 4  # glTF's mode of a primitive
_WELD = 1e-5  # share of the height: vertices that are split where textures meet are one
_DAMAGED = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RecursionError)


def write_body(folder: Path, skeleton: Skeleton) -> bool:
    """Write a show's surface (`body.npz`): of BODY_FILE where the bundle has one, else of the modelled body.

    Returns whether it was written; it is not where it is there. Raises ExchangeError, OSError.
    """
    path = folder / BODY_FILE
    if not path.is_file():
        return write_mesh(folder, skeleton)
    source = hashlib.sha256(path.read_bytes()).hexdigest()
    return write_mesh(folder, skeleton, lambda: body_of(path, skeleton), source)


def body_of(path: Path, skeleton: Skeleton) -> BodyMesh:
    """The skinned figure of a file, its bones laid onto those of the skeleton at rest.

    Joints are found by their names. The skin of a joint that the skeleton lacks follows the nearest one above
    it that the skeleton has. Raises ExchangeError, OSError.
    """
    file = GlbFile(path)
    try:
        return _fitted(_Figure(file), skeleton)
    except ExchangeError:
        raise
    except _DAMAGED as error:
        raise ExchangeError(path, f"The file is damaged or not as glTF 2 says ({error}).") from error


class _Figure:
    """All skinned triangles of a file, in the pose in which they were bound.

    vertices (V, 3); faces (F, 3); joints, weights (V, 4); names, parents, places (N, 3) of its joints.
    """

    def __init__(self, file: GlbFile) -> None:
        self.path = file.path
        document = file.document
        nodes = document.get("nodes", [])
        above = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
        worn = [node for node in nodes if "mesh" in node and "skin" in node]
        if not worn:
            raise ExchangeError(file.path, "No skinned figure is in it. Export the mesh with its skeleton.")
        skins = {node["skin"] for node in worn}
        known = sorted({joint for skin in skins for joint in document["skins"][skin]["joints"]})
        known.sort(key=lambda joint: _depth(joint, above))
        row = {joint: number for number, joint in enumerate(known)}
        self.names = [str(nodes[joint].get("name", f"joint{joint}")) for joint in known]
        self.parents = [_parent(joint, above, row) for joint in known]
        self.places = np.zeros((len(known), 3))
        for skin in skins:
            joints = document["skins"][skin]["joints"]
            bound = np.linalg.inv(
                np.swapaxes(file.array(document["skins"][skin]["inverseBindMatrices"]), 1, 2)
            )
            self.places[[row[joint] for joint in joints]] = bound[:, :3, 3]
        parts = [
            _primitive(file, primitive, [row[joint] for joint in document["skins"][node["skin"]]["joints"]])
            for node in worn
            for primitive in document["meshes"][node["mesh"]]["primitives"]
            if primitive.get("mode", _TRIANGLES) == _TRIANGLES
        ]
        if not parts:
            raise ExchangeError(file.path, "Its skinned figure has no triangles. Export it as a mesh.")
        starts = np.cumsum([0, *(len(part[0]) for part in parts)])
        self.vertices = np.concatenate([part[0] for part in parts])
        self.faces = np.concatenate([part[1] + start for part, start in zip(parts, starts, strict=False)])
        self.joints = np.concatenate([part[2] for part in parts])
        self.weights = np.concatenate([part[3] for part in parts])
        if len(self.faces) > MOST_TRIANGLES:
            raise ExchangeError(
                file.path,
                f"The figure has {len(self.faces)} triangles; the projector of a small computer draws "
                f"{MOST_TRIANGLES}. Decimate it in Blender (Modifier, Decimate), then export again.",
            )
        if not np.isfinite(self.vertices).all() or not np.isfinite(self.places).all():
            raise ValueError("places that are no numbers")


def _primitive(
    file: GlbFile, primitive: dict[str, Any], rows: list[int]
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
    attributes = primitive["attributes"]
    if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
        raise ExchangeError(file.path, "Its mesh is compressed (Draco). Export it without compression.")
    if "JOINTS_0" not in attributes or "WEIGHTS_0" not in attributes:
        raise ExchangeError(file.path, "A part of its figure is not skinned. Bind all of it to the skeleton.")
    vertices = file.array(attributes["POSITION"])
    count = len(vertices)
    indices = file.array(primitive["indices"]) if "indices" in primitive else np.arange(count)
    faces = indices.astype(np.int64).reshape(-1, 3)
    joints = np.array(rows)[file.array(attributes["JOINTS_0"]).astype(np.int64)]
    weights = np.maximum(file.array(attributes["WEIGHTS_0"]), 0.0)
    if vertices.shape != (count, 3) or joints.shape != (count, 4) or weights.shape != (count, 4):
        raise ValueError("vertices, joints and weights do not fit each other")
    if faces.min(initial=0) < 0 or faces.max(initial=0) >= count:
        raise ValueError("a triangle with a vertex that is not there")
    return vertices, faces, joints, weights


def _depth(joint: int, above: dict[int, int]) -> int:
    depth = 0
    while joint in above:
        joint, depth = above[joint], depth + 1
        if depth > len(above):
            raise ValueError("nodes are their own parents")
    return depth


def _parent(joint: int, above: dict[int, int], row: dict[int, int]) -> int:
    """The row of the nearest joint above; -1 without one."""
    while joint in above:
        joint = above[joint]
        if joint in row:
            return row[joint]
    return -1


def _fitted(figure: _Figure, skeleton: Skeleton) -> BodyMesh:
    theirs, ours = roles_of(figure.names), skeleton.roles
    for what, roles in (("the figure", theirs), ("the show's skeleton", ours)):
        if missing := missing_roles(roles):
            raise ExchangeError(
                figure.path,
                f"No joint of {what} is named as {', '.join(missing)}. Name the bones as Mixamo, VRM or "
                "Unreal do, then export again.",
            )
    anatomy = anatomy_of(skeleton)
    worn_by = _worn_by(figure, skeleton)
    turn, scale = _towards(figure.places, theirs, anatomy.positions, ours)
    vertices, places = (scale * values @ turn.T for values in (figure.vertices, figure.places))
    moved = _laid_on(vertices, places, figure, worn_by, anatomy.positions, skeleton)
    weights = np.zeros((len(moved), len(skeleton)))
    for corner in range(figure.joints.shape[1]):
        np.add.at(
            weights, (np.arange(len(moved)), worn_by[figure.joints[:, corner]]), figure.weights[:, corner]
        )
    cells = np.round(moved / (_WELD * anatomy.height)).astype(np.int64)
    _, first, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = number.reshape(-1)[figure.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        raise ValueError("no triangle has an area")
    joints, shares = _strongest(weights[first])
    return BodyMesh(
        moved[first].astype(np.float32),
        _normals(moved[first], faces),
        faces.astype(np.int32),
        joints,
        shares,
        anatomy.height,
        anatomy.positions.astype(np.float32),
        anatomy.world.astype(np.float32),
    )


def _worn_by(figure: _Figure, skeleton: Skeleton) -> NDArray[np.int64]:
    """(N,): which joint of the skeleton moves what hangs on each joint of the figure."""
    theirs, ours = roles_of(figure.names), skeleton.roles
    found = {joint: ours[role] for role, joint in theirs.items() if role in ours}
    same = {place: joint for joint, place in enumerate(places_of(skeleton.names)) if place is not None}
    for joint, place in enumerate(places_of(figure.names)):
        if joint not in found and place is not None and place in same:
            found[joint] = same[place]
    worn_by = np.full(len(figure.names), ours["hips"], np.int64)
    for joint, parent in enumerate(figure.parents):  # parents come first
        worn_by[joint] = found.get(joint, worn_by[parent] if parent >= 0 else ours["hips"])
    return worn_by


def _towards(
    places: Array, theirs: dict[str, int], targets: Array, ours: dict[str, int]
) -> tuple[Array, float]:
    """The turn (3, 3) and the scale that bring the figure's axes and size to the skeleton's."""

    def axes(at: Array, roles: dict[str, int]) -> tuple[Array, float]:
        up = at[roles["head"]] - at[roles["hips"]]
        across = at[roles["left thigh"]] - at[roles["right thigh"]]
        leg = at[roles["left foot"]] - at[roles["left thigh"]]
        size = float(np.linalg.norm(up) + np.linalg.norm(leg))
        up = up / np.linalg.norm(up)
        across = across - up * float(across @ up)
        across = across / np.linalg.norm(across)
        return np.array([across, up, np.cross(across, up)]), size

    (one, small), (other, large) = axes(places, theirs), axes(targets, ours)
    if not small > 0.0:
        raise ValueError("all joints are in one place")
    return other.T @ one, large / small


def _laid_on(
    vertices: Array,
    places: Array,
    figure: _Figure,
    worn_by: NDArray[np.int64],
    targets: Array,
    skeleton: Skeleton,
) -> Array:
    """(V, 3): the vertices after each bone was turned, stretched and moved onto the skeleton's."""
    start = {int(ours): joint for joint, ours in reversed(list(enumerate(worn_by)))}
    total = np.zeros_like(vertices)
    weights = figure.weights / np.maximum(figure.weights.sum(axis=1, keepdims=True), 1e-9)
    turns: dict[int, Array] = {}
    roles = skeleton.roles
    top, thighs = roles.get("neck", roles["head"]), [roles["left thigh"], roles["right thigh"]]
    below = places[[start[thigh] for thigh in thighs]].mean(axis=0), targets[thighs].mean(axis=0)
    trunk = skeleton.ancestors(skeleton.parents[top])
    for ours in sorted(start):
        children = [c for c, parent in enumerate(skeleton.parents) if parent == ours and c in start]
        child = max(children, key=lambda c: float(np.linalg.norm(skeleton.offsets[c])), default=None)
        above = (joint for joint in skeleton.ancestors(ours)[1:] if joint in turns)
        turn = turns.get(next(above, -1), quaternion.IDENTITY)
        root, laid = places[start[ours]], targets[ours]
        if ours in trunk:  # all in one piece: where spines are divided differently, pieces would overlap
            (root, laid), child = below, top
        elif ours in skeleton.feet:
            turn, child = quaternion.IDENTITY, None  # soles stay level, whatever way the shin leans
        bone, length, along = np.zeros(3), 0.0, 1.0
        if child is not None and child in start:
            bone, target = places[start[child]] - root, targets[child] - laid
            length = float(np.linalg.norm(bone))
            if length > 1e-6 and float(np.linalg.norm(target)) > 1e-6:
                turn, along = shortest_turn(bone, target), float(np.linalg.norm(target)) / length
                bone = bone / length
        turns[ours] = np.asarray(turn, float)
        share = np.where(worn_by[figure.joints] == ours, weights, 0.0).sum(axis=1)
        chosen = share > 0.0
        away = vertices[chosen] - root
        away = away + (along - 1.0) * np.clip(away @ bone, 0.0, length)[:, None] * bone
        total[chosen] += share[chosen, None] * (laid + quaternion.rotate(turns[ours], away))
    return total


def _strongest(weights: Array) -> tuple[JointNumbers, NDArray[np.float32]]:
    count = weights.shape[1]
    weights = np.pad(weights, ((0, 0), (0, max(0, MOVERS - weights.shape[1]))))
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :MOVERS]
    kept = np.take_along_axis(weights, joints, axis=1)
    total = kept.sum(axis=1, keepdims=True)
    kept = np.where(total > 1e-6, kept / np.maximum(total, 1e-6), np.eye(1, MOVERS))
    joints = np.where(kept > 0.0, joints, joints[:, :1])
    return joint_numbers(joints, count), kept.astype(np.float32)


def _normals(vertices: Array, faces: NDArray[np.int64]) -> NDArray[np.float32]:
    """(V, 3): of each vertex the mean of its triangles', by their areas."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, faces[:, corner], across)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    normals: NDArray[np.float32] = np.where(
        length > 1e-12, total / np.maximum(length, 1e-12), [0.0, 1.0, 0.0]
    )
    return normals.astype(np.float32)
