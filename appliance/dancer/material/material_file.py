"""Material files: a loop with its recipe, as the generator hands it to the stage and keeps it on the disk."""

from __future__ import annotations

import json
import mmap
import os
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appliance.box.durable import private_folder, write_whole
from appliance.dancer.loop import Loop, Placement
from appliance.dancer.slerp import FloatArray
from appliance.pose.foreign_file import opened, plain_json
from appliance.pose.possible import FARTHEST_ON_STAGE_M

SUFFIX = ".material"
LARGEST = 64 * 2**20  # bytes: ten minutes of a figure of 43 joints are 22 MB

_MAGIC = b"bunraku material 1\n"
_HEAD = struct.Struct("<19sxI")  # magic, bytes of the facts
_ALIGNED = 64
_UNIT = 0.01  # how far the mean square of unit quaternions may be from 1


class Material(NamedTuple):
    """A loop, and the recipe that it was made by: JSON with the keys in order."""

    recipe: str
    loop: Loop


def recipe_text(recipe: dict[str, Any]) -> str:
    """A recipe as it travels: the same values, the same text."""
    return json.dumps(recipe, sort_keys=True, separators=(",", ":"))


def parsed_recipe(text: str) -> dict[str, Any]:
    """Raises ValueError for no recipe."""
    recipe = plain_json(text)
    if not isinstance(recipe, dict):
        raise ValueError("This is no recipe.")
    return recipe


def write_material(path: Path, material: Material, joints: tuple[str, ...]) -> None:
    """Replace the file as a whole. Raises OSError."""
    loop = material.loop
    poses, track = (np.ascontiguousarray(part, np.float32) for part in (loop.poses, loop.track))
    facts = {
        "recipe": material.recipe,
        "joints": joints,
        "shapes": [poses.shape, track.shape],
        "step": [loop.step.yaw, loop.step.x, loop.step.z],
        "start_s": loop.start_s,
    }
    encoded = json.dumps(facts).encode()
    encoded = encoded.ljust(-(-(_HEAD.size + len(encoded)) // _ALIGNED) * _ALIGNED - _HEAD.size)
    private_folder(path.parent)
    write_whole(path, b"".join((_HEAD.pack(_MAGIC, len(encoded)), encoded, poses.tobytes(), track.tobytes())))


def read_material(path: Path, joints: tuple[str, ...]) -> Material:
    """The material of a file, mapped and not copied. Raises OSError, and ValueError for another figure's."""
    try:
        with opened(path) as stream:
            if os.fstat(stream.fileno()).st_size > LARGEST:
                raise ValueError("it is too large")
            flags = mmap.MAP_PRIVATE | mmap.MAP_POPULATE
            memory = mmap.mmap(stream.fileno(), 0, flags, mmap.PROT_READ)
        magic, length = _HEAD.unpack_from(memory)
        if magic != _MAGIC:
            raise ValueError("it is none")
        facts = plain_json(memory[_HEAD.size : _HEAD.size + length])
        (rows, figure, four), (track_rows, columns) = facts["shapes"]
        if tuple(facts["joints"]) != joints or figure != len(joints) or four != 4 or rows != track_rows:
            raise ValueError("it is of another figure")
        if rows < 2:
            raise ValueError("it is empty")
        at = _HEAD.size + length
        poses = np.frombuffer(memory, np.float32, rows * figure * 4, at).reshape(rows, figure, 4)
        track = np.frombuffer(memory, np.float32, rows * columns, at + poses.nbytes).reshape(rows, columns)
        yaw, x, z = map(float, facts["step"])
        _require_possible(poses, track, (yaw, x, z, float(facts["start_s"])))
        loop = Loop.made(poses, track, Placement(yaw, x, z), float(facts["start_s"]))
        return Material(str(facts["recipe"]), loop)
    except (LookupError, TypeError, ArithmeticError, struct.error, ValueError) as error:
        raise ValueError(f"{path} is no material of this show ({error}).") from None


def _require_possible(poses: FloatArray, track: FloatArray, step: tuple[float, ...]) -> None:
    """Raises ValueError for numbers that nobody danced; one pass over each array, because a tick waits."""
    flat = poses.reshape(-1)
    if not abs(4 * float(flat.dot(flat)) / flat.size - 1.0) < _UNIT:
        raise ValueError("its poses are invalid")
    if not (np.abs(track[:, :4]).max() <= FARTHEST_ON_STAGE_M and max(map(abs, step)) <= FARTHEST_ON_STAGE_M):
        raise ValueError("its places are invalid")
