"""Recordings as binary glTF: joints as nodes, a body skinned to them, an animation of the dance."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.body.body_mesh import body_mesh
from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_file import GlbBuffer
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording

MAX_JOINTS = 256  # that a body's vertices can name
_VERTICES, _INDICES = 34962, 34963
_IVORY = [0.86, 0.8, 0.7, 1.0]


def write_glb(path: Path, recording: Recording) -> None:
    """Write a file for Blender, three.js, TouchDesigner: metres, Y up, linear between frames.

    A joint's node has its rotation relative to the parent, as a pose has it; the root's also its place. The
    end of a bone is a node without children, named after its joint. Raises ExchangeError, OSError.
    """
    figure = recording.skeleton
    if len(figure) > MAX_JOINTS:
        raise ExchangeError(
            path, f"The figure has {len(figure)} joints, a body at most {MAX_JOINTS}. Write .npz or .bvh."
        )
    buffer = GlbBuffer()
    nodes = _nodes(recording)
    primitive, inverse_bind = _body(recording, buffer)
    nodes.append({"name": "Body", "mesh": 0, "skin": 0})
    document = {
        "asset": {"version": "2.0", "generator": "Bunraku"},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [{"name": "Body", "primitives": [primitive]}],
        "materials": [
            {
                "name": "Body",
                "pbrMetallicRoughness": {
                    "baseColorFactor": _IVORY,
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.8,
                },
            }
        ],
        "skins": [{"joints": list(range(len(figure))), "skeleton": 0, "inverseBindMatrices": inverse_bind}],
        "animations": [_animation(recording, buffer)],
    }
    buffer.write(path, document)


def _nodes(recording: Recording) -> list[dict[str, Any]]:
    """The joints in the skeleton's order, standing as in the first frame, then the ends of bones."""
    figure = recording.skeleton
    places = np.array(figure.offsets, float) if recording.translations is None else recording.translations[0]
    nodes: list[dict[str, Any]] = [
        {
            "name": name,
            "translation": [float(part) for part in (place if joint else recording.roots[0])],
            "rotation": _xyzw(recording.poses[0, joint]).tolist(),
        }
        for joint, (name, place) in enumerate(zip(figure.names, places, strict=True))
    ]
    for joint, offset in figure.ends:
        nodes.append({"name": f"{figure.names[joint]}_end", "translation": [float(part) for part in offset]})
        nodes[joint].setdefault("children", []).append(len(nodes) - 1)
    for joint, parent in enumerate(figure.parents):
        if parent >= 0:
            nodes[parent].setdefault("children", []).append(joint)
    return nodes


def _xyzw(q: Array) -> NDArray[np.float32]:
    """In the order of glTF."""
    return np.roll(quaternion.normalize(np.asarray(q, np.float64)), -1, axis=-1).astype(np.float32)


def _body(recording: Recording, buffer: GlbBuffer) -> tuple[dict[str, Any], int]:
    """The sculpted body as a primitive, and the accessor of the inverse bind matrices."""
    mesh = body_mesh(recording.skeleton)
    joints = np.where(mesh.weights > 0, mesh.joints, 0).astype(mesh.joints.dtype)
    normals = mesh.normals.astype(np.float64)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.5, normals / np.maximum(length, 1e-9), [0.0, 1.0, 0.0])
    index = np.uint16 if len(mesh.vertices) < 1 << 16 else np.uint32
    attributes = {
        "POSITION": buffer.add(mesh.vertices.astype(np.float32), _VERTICES, bounds=True),
        "NORMAL": buffer.add(normals.astype(np.float32), _VERTICES),
        "JOINTS_0": buffer.add(joints, _VERTICES),
        "WEIGHTS_0": buffer.add(mesh.weights.astype(np.float32), _VERTICES),
    }
    indices = buffer.add(mesh.faces.reshape(-1).astype(index), _INDICES)
    back = quaternion.inverse(mesh.bind_world.astype(np.float64))
    matrices = np.tile(np.eye(4), (len(recording.skeleton), 1, 1))
    matrices[:, :3, :3] = quaternion.to_matrix(back)
    matrices[:, :3, 3] = -quaternion.rotate(back, mesh.bind_positions.astype(np.float64))
    columns = np.swapaxes(matrices, 1, 2).astype(np.float32)  # glTF has matrices column by column
    return {"attributes": attributes, "indices": indices, "material": 0}, buffer.add(columns)


def _animation(recording: Recording, buffer: GlbBuffer) -> dict[str, Any]:
    times = (np.arange(len(recording)) / recording.fps).astype(np.float32)
    input_ = buffer.add(times, bounds=True)
    tracks = [("translation", 0, recording.roots)]
    tracks += [("rotation", joint, recording.poses[:, joint]) for joint in range(len(recording.skeleton))]
    if recording.translations is not None:
        tracks += [
            ("translation", joint, recording.translations[:, joint])
            for joint in range(1, len(recording.skeleton))
        ]
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for path, node, values in tracks:
        array = _xyzw(quaternion.continuous(values)) if path == "rotation" else values.astype(np.float32)
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append({"input": input_, "output": buffer.add(array), "interpolation": "LINEAR"})
    return {"name": "Dance", "samplers": samplers, "channels": channels}
