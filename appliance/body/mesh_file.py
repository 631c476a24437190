"""The body's surface as a file of the show bundle: a projector reads it and need not model it at its start.

`body.npz` has what a GPU is given: vertices in 16 bits, normals and weights in 8. Most faces come in pairs,
as `surface_of` makes them, so four corners describe two; in single ones the last corner is there twice. The
file has what `bake` computes, too, and a hash of the skeleton and of the model's number; a file with another
hash is not used.
"""

from __future__ import annotations

import hashlib
import io
import json
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.body.bake import bake
from appliance.body.body_mesh import SPACING, body_mesh
from appliance.body.skinning import MOVERS, Baked, BodyMesh, joint_numbers
from appliance.pose.foreign_file import content, require_inside
from appliance.pose.skeleton import Skeleton
from appliance.pose.whole_file import written_whole

MESH_FILE = "body.npz"
MODEL = 8  # another number where sculpture, surface, weights or `bake` change: files of before are made again
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
            arrays = {name: loaded[name] for name in loaded.files}
        mesh = unpacked(arrays, len(skeleton))
        baked = None if mesh is None else _baked(arrays, mesh)
        return None if mesh is None or baked is None else replace(mesh, baked=baked)
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
    surface = _packed(body_mesh(skeleton) if model is None else model())
    arrays = surface | _packed_bake(surface)
    with written_whole(folder / MESH_FILE) as written:
        np.savez_compressed(written, key=np.array(mesh_key(skeleton)), source=np.array(source), **arrays)
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
        "normals": _signed_bytes(mesh.normals),
        "quads": _bytes(quads.T),
        "joints": mesh.joints.T,
        "weights": np.round(255.0 * mesh.weights).astype(np.uint8).T,
        "height": np.float64(mesh.height),
        "bind_positions": mesh.bind_positions,
        "bind_world": mesh.bind_world,
    }


def _packed_bake(surface: Arrays) -> Arrays:
    """The arrays of what is computed from a packed surface as a reader gets it. Normals are differences from
    its own, and each face has its place in the order."""
    baked = bake(_surface(surface))
    return {
        "open": _signed_bytes(baked.open),
        "sunk": baked.sunk.astype(np.float16).T,
        "calm": _signed_bytes(baked.calm) - surface["normals"],
        "order": _bytes(np.diff(np.argsort(baked.order), prepend=0).astype(np.int32)),
    }


def _baked(arrays: Arrays, mesh: BodyMesh) -> Baked | None:
    """The reverse of `_packed_bake`; None if it does not fit the mesh. Raises as `unpacked`."""
    baked = Baked(
        _signed(arrays["open"]),
        arrays["sunk"].T.astype(np.float16),
        _signed(arrays["normals"] + arrays["calm"]),
        np.argsort(np.cumsum(_numbers(arrays["order"]))),
    )
    numbers = (baked.open, baked.sunk, baked.calm)
    is_whole = (
        baked.order.shape == mesh.faces.shape[:1]
        and baked.open.shape == mesh.vertices.shape[:1]
        and baked.sunk.shape == baked.calm.shape == mesh.vertices.shape
        and all(bool(np.isfinite(part).all()) for part in numbers)
    )
    return baked if is_whole else None


def _signed_bytes(values: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Numbers from -1 to 1, transposed, as a GPU has them."""
    return np.round(255.0 * (0.5 + 0.5 * values)).astype(np.uint8).T


def _signed(columns: NDArray[np.uint8]) -> NDArray[np.float32]:
    """The reverse of `_signed_bytes`."""
    return np.ascontiguousarray(columns.T.astype(np.float32) / 127.5 - 1.0, np.float32)


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
    """The surface of these arrays, without what is baked; None if they do not fit. Raises ValueError,
    LookupError, TypeError."""
    mesh = _surface(arrays)
    return mesh if _is_whole(mesh, joint_count) else None


def _surface(arrays: Arrays) -> BodyMesh:
    """The reverse of `_packed`. Raises as `unpacked`."""
    low, high = arrays["vertices"].astype(np.float32)
    vertices = np.ascontiguousarray((arrays["step"] * (low + 256.0 * high)).T + arrays["low"], np.float32)
    quads = _numbers(arrays["quads"]).T.copy()
    quads[:, 0] = np.cumsum(quads[:, 0])
    quads[:, 1:] += quads[:, :1]
    faces = quads[:, _PAIR].reshape(-1, 3)
    faces = faces[faces[:, 1] != faces[:, 2]]
    weights = arrays["weights"].T.astype(np.float32) / 255.0
    return BodyMesh(
        vertices,
        _signed(arrays["normals"]),
        np.ascontiguousarray(faces, np.int32),
        np.ascontiguousarray(arrays["joints"].T),
        np.ascontiguousarray(weights, np.float32),
        float(arrays["height"]),
        arrays["bind_positions"],
        arrays["bind_world"],
    )


def _is_whole(mesh: BodyMesh, joint_count: int) -> bool:
    """Whether everything has its shape and names vertices and joints that there are."""
    count = len(mesh.vertices)
    numbers = (mesh.vertices, mesh.normals, mesh.weights, mesh.bind_positions, mesh.bind_world)
    return (
        (mesh.vertices.shape, mesh.normals.shape) == ((count, 3), (count, 3))
        and (mesh.joints.shape, mesh.weights.shape) == ((count, MOVERS), (count, MOVERS))
        and (mesh.bind_positions.shape, mesh.bind_world.shape) == ((joint_count, 3), (joint_count, 4))
        and mesh.joints.dtype == joint_numbers(mesh.joints, joint_count).dtype
        and all(part.dtype == np.float32 and bool(np.isfinite(part).all()) for part in numbers)
        and 0.0 < mesh.height < np.inf
        and count > 0
        and len(mesh.faces) > 0
        and 0 <= int(mesh.faces.min()) <= int(mesh.faces.max()) < count
        and int(mesh.joints.max()) < joint_count
    )
