"""The body's surface as a file of the show bundle: a projector reads it and need not model it at its start.

`body.npz` has what a GPU is given: vertices in 16 bits, normals and weights in 8. Most faces come in pairs,
as `surface_of` makes them, so four corners describe two; in single ones the last corner is there twice. The
file has a hash of the skeleton and of the model's number; a file with another hash is not used.
"""

from __future__ import annotations

import hashlib
import io
import json
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.body.body_mesh import SPACING, body_mesh
from appliance.body.skinning import MOVERS, BodyMesh
from appliance.pose.foreign_file import content, require_inside
from appliance.pose.skeleton import Skeleton

MESH_FILE = "body.npz"
MODEL = 5  # another number where sculpture, surface or weights change: files of before are made again
LARGEST_BYTES = 4_000_000
_LARGEST_UNPACKED = 16_000_000
_DIGITS = 6  # decimals in the key: a skeleton that was written as text has the same
_PAIR = [0, 1, 2, 0, 2, 3]  # two triangles as corners of the quad that they are halves of

_UNREADABLE = (
    *(OSError, ValueError, LookupError, TypeError, EOFError, RuntimeError, MemoryError, OverflowError),
    *(zipfile.BadZipFile, zlib.error, SyntaxError, tokenize.TokenError),
)

Arrays = dict[str, Any]  # NDArray by name


def mesh_of_show(skeleton: Skeleton, folder: Path | None) -> BodyMesh:
    """The surface in the show's folder if it is that of this skeleton, else a new one (half a second)."""
    found = None if folder is None else read_mesh(folder, skeleton)
    return body_mesh(skeleton) if found is None else found


def read_mesh(folder: Path, skeleton: Skeleton) -> BodyMesh | None:
    """The surface in a show's folder; None without one for this skeleton. Never raises."""
    try:
        require_inside(folder / MESH_FILE, folder)
        data = content(folder / MESH_FILE, LARGEST_BYTES)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(member.file_size for member in archive.infolist()) > _LARGEST_UNPACKED:
                return None
        with np.load(io.BytesIO(data), allow_pickle=False) as loaded:
            if str(loaded["key"]) != mesh_key(skeleton):
                return None
            return unpacked({name: loaded[name] for name in loaded.files}, len(skeleton))
    except _UNREADABLE:
        return None


def write_mesh(
    folder: Path, skeleton: Skeleton, model: Callable[[], BodyMesh] | None = None, source: str = ""
) -> bool:
    """Write the skeleton's surface into a show's folder, unless it is there; returns whether it was written.

    model: makes a surface from a file of that hash (`source`), in place of the modelled one. Raises OSError
    and what `model` raises.
    """
    if read_mesh(folder, skeleton) is not None and _source(folder) == source:
        return False
    mesh = body_mesh(skeleton) if model is None else model()
    written = folder / f".{MESH_FILE}.new"
    with written.open("wb") as stream:
        np.savez_compressed(
            stream, key=np.array(mesh_key(skeleton)), source=np.array(source), **_packed(mesh)
        )
    written.replace(folder / MESH_FILE)
    return True


def _source(folder: Path) -> str:
    """The hash of the file that the surface in a show's folder was made from; '' for a modelled one."""
    with np.load(folder / MESH_FILE, allow_pickle=False) as loaded:
        return str(loaded["source"]) if "source" in loaded.files else ""


def mesh_key(skeleton: Skeleton) -> str:
    """A hash of everything that a surface depends on."""
    ends = [[joint, *_rounded(offset)] for joint, offset in skeleton.ends]
    figure = [skeleton.names, skeleton.parents, _rounded(skeleton.offsets), ends, _rounded(skeleton.standing)]
    return hashlib.sha256(json.dumps([MODEL, SPACING, *figure]).encode()).hexdigest()


def _rounded(values: Any) -> list[Any]:
    """Numbers as they are compared; minus zero is zero."""
    rounded: list[Any] = (np.round(np.asarray(values, np.float64), _DIGITS) + 0.0).tolist()
    return rounded


def _packed(mesh: BodyMesh) -> Arrays:
    """The arrays of the file: the longer ones by columns, and in bytes, which compress better."""
    low = mesh.vertices.min(axis=0)
    step = np.float32((mesh.vertices.max(axis=0) - low).max() / 65535)
    places = np.round((mesh.vertices - low) / step).astype(np.uint16).T
    quads = _paired(mesh.faces)
    quads[:, 1:] -= quads[:, :1]
    quads[1:, 0] = np.diff(quads[:, 0])
    return {
        "low": low,
        "step": step,
        "vertices": np.stack([places & 255, places >> 8]).astype(np.uint8),
        "normals": np.round(255.0 * (0.5 + 0.5 * mesh.normals)).astype(np.uint8).T,
        "quads": _bytes(quads.T),
        "joints": mesh.joints.T,
        "weights": np.round(255.0 * mesh.weights).astype(np.uint8).T,
        "height": np.float64(mesh.height),
        "bind_positions": mesh.bind_positions,
        "bind_world": mesh.bind_world,
    }


def _paired(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """(Q, 4) corners of the pairs that faces begin with, then of single ones."""
    even = faces[: len(faces) // 2 * 2].reshape(-1, 2, 3)
    is_pair = (even[:, 0, [0, 2]] == even[:, 1, :2]).all(axis=1)
    pairs = len(is_pair) if is_pair.all() else int(is_pair.argmin())
    paired = np.concatenate([even[:pairs, 0], even[:pairs, 1, 2:]], axis=1)
    single = faces[2 * pairs :][:, [0, 1, 2, 2]]
    return np.concatenate([paired, single]).astype(np.int32)


def _bytes(values: NDArray[np.int32]) -> NDArray[np.uint8]:
    """(4, ...): the lowest byte of each number, then the next ones."""
    split = np.ascontiguousarray(values, "<i4")[..., None].view(np.uint8)
    return np.ascontiguousarray(np.moveaxis(split, -1, 0))


def _numbers(planes: NDArray[np.uint8]) -> NDArray[np.int32]:
    """The reverse of `_bytes`."""
    joined: NDArray[np.int32] = np.ascontiguousarray(np.moveaxis(planes, 0, -1)).view("<i4")[..., 0]
    return joined


def unpacked(arrays: Arrays, joint_count: int) -> BodyMesh | None:
    """The surface of these arrays; None if they do not fit. Raises ValueError, LookupError, TypeError."""
    low, high = arrays["vertices"].astype(np.float32)
    vertices = np.ascontiguousarray((arrays["step"] * (low + 256.0 * high)).T + arrays["low"], np.float32)
    quads = _numbers(arrays["quads"]).T.copy()
    quads[:, 0] = np.cumsum(quads[:, 0])
    quads[:, 1:] += quads[:, :1]
    faces = quads[:, _PAIR].reshape(-1, 3)
    faces = faces[faces[:, 1] != faces[:, 2]]
    normals = arrays["normals"].T.astype(np.float32) / 127.5 - 1.0
    weights = arrays["weights"].T.astype(np.float32) / 255.0
    mesh = BodyMesh(
        vertices,
        np.ascontiguousarray(normals, np.float32),
        np.ascontiguousarray(faces, np.int32),
        np.ascontiguousarray(arrays["joints"].T),
        np.ascontiguousarray(weights, np.float32),
        float(arrays["height"]),
        arrays["bind_positions"],
        arrays["bind_world"],
    )
    return mesh if _is_whole(mesh, joint_count) else None


def _is_whole(mesh: BodyMesh, joint_count: int) -> bool:
    """Whether everything has its shape and names vertices and joints that there are."""
    count = len(mesh.vertices)
    numbers = (mesh.vertices, mesh.normals, mesh.weights, mesh.bind_positions, mesh.bind_world)
    return (
        (mesh.vertices.shape, mesh.normals.shape) == ((count, 3), (count, 3))
        and (mesh.joints.shape, mesh.weights.shape) == ((count, MOVERS), (count, MOVERS))
        and (mesh.bind_positions.shape, mesh.bind_world.shape) == ((joint_count, 3), (joint_count, 4))
        and mesh.joints.dtype == np.uint8
        and all(part.dtype == np.float32 and bool(np.isfinite(part).all()) for part in numbers)
        and 0.0 < mesh.height < np.inf
        and count > 0
        and len(mesh.faces) > 0
        and 0 <= int(mesh.faces.min()) <= int(mesh.faces.max()) < count
        and int(mesh.joints.max()) < joint_count
    )
