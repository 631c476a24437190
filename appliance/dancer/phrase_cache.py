"""Phrases prepared once: read, resampled and surveyed they are kept as numbers, for the next start."""

from __future__ import annotations

import contextlib
import hashlib
import json
import mmap
import os
import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from appliance.box.durable import write_whole
from appliance.dancer.forward_kinematics import soles_of
from appliance.dancer.grounding import Floor, survey
from appliance.dancer.phrase import FPS
from appliance.dancer.slerp import FloatArray
from appliance.pose.bvh import read_bvh
from appliance.pose.foreign_file import opened, plain_json
from appliance.pose.possible import possible_roots
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

FOLDER = ".prepared"  # in a show bundle: hidden, so it is no part of what was packed
MEMORY = "prepared"  # in the folder where the box's processes meet
SUFFIX = ".phrase"
LARGEST = 64 * 2**20  # bytes: longer phrases are read again, the folder may be one in memory

_MAGIC = b"bunraku phrase 2\n"  # 2: impossible steps of the root are left out
_HEAD = struct.Struct("<17sII3x")  # magic, bytes of the facts, CRC-32 of all that follows
_ALIGNED = 64


class PhraseCache:
    """Where prepared phrases lie: in the show's bundle, and in memory for as long as the machine runs."""

    def __init__(self, bundle: Path, memory: Path | None) -> None:
        """memory: a folder where what had to be read is kept; it holds the phrases of one show."""
        self._looked_in = tuple(folder for folder in (memory, bundle / FOLDER) if folder is not None)
        self._memory = memory
        self._used: set[str] = set()

    def phrase(self, path: Path, skeleton: Skeleton, grounded: bool) -> tuple[Recording, Floor | None] | None:
        """A phrase at the tick's rate and its floor; None where its joints are not the skeleton's.

        The cached result is bit for bit the one read from the BVH file, and loads in a hundredth of the time.
        Raises as read_bvh and survey do.
        """
        name = _name(path, grounded)
        self._used.add(name)
        for folder in self._looked_in:
            found = _cached(folder / name, skeleton)
            if found is not None:
                return found
        phrase = read_bvh(path)
        if not phrase.skeleton.same_joints(skeleton):
            return None
        phrase = replace(phrase, roots=possible_roots(phrase.roots, phrase.fps)).resampled(FPS)
        floor = survey(phrase) if grounded else None
        if self._memory is not None:
            with contextlib.suppress(OSError):
                _keep(self._memory / name, phrase, floor)
        return phrase, floor

    def forget_others(self) -> None:
        """Free the memory of phrases that were not asked for: they belong to another show."""
        if self._memory is None:
            return
        with contextlib.suppress(OSError):
            for path in self._memory.iterdir():
                if path.name not in self._used:
                    path.unlink()


def prepare(phrases: Iterable[Path], bundle: Path, skeleton: Skeleton, grounded: bool) -> None:
    """Prepare a bundle's phrases in its own folder, so that even its first start is a quick one.

    Does nothing where the folder takes no file. Raises as read_bvh and survey do.
    """
    preparations = PhraseCache(bundle, bundle / FOLDER)
    for path in phrases:
        preparations.phrase(path, skeleton, grounded)
    preparations.forget_others()


def _name(path: Path, grounded: bool) -> str:
    """The file's name says what it was made from."""
    made_from = hashlib.sha256(_MAGIC + b"grounded" * grounded)
    with path.open("rb") as stream:
        while chunk := stream.read(2**20):
            made_from.update(chunk)
    return made_from.hexdigest() + SUFFIX


def _keep(path: Path, phrase: Recording, floor: Floor | None) -> None:
    """Raises OSError without room."""
    arrays = [np.ascontiguousarray(array, np.float32) for array in _arrays(phrase, floor)]
    names = {"joints": phrase.skeleton.names, "parents": [int(parent) for parent in phrase.skeleton.parents]}
    facts = json.dumps({**names, "shapes": [array.shape for array in arrays]}).encode()
    facts = facts.ljust(-(-(_HEAD.size + len(facts)) // _ALIGNED) * _ALIGNED - _HEAD.size)
    parts = [facts, *(array.tobytes() for array in arrays)]
    size = _HEAD.size + sum(map(len, parts))
    if size > LARGEST:
        return
    path.parent.mkdir(mode=0o700, exist_ok=True)
    free = os.statvfs(path.parent)
    if free.f_bavail * free.f_frsize < 2 * size:
        return
    check = 0
    for part in parts:
        check = zlib.crc32(part, check)
    write_whole(path, b"".join((_HEAD.pack(_MAGIC, len(facts), check), *parts)))


def _cached(path: Path, skeleton: Skeleton) -> tuple[Recording, Floor | None] | None:
    """The cached phrase, not copied; None without one that is valid for this skeleton."""
    try:
        with opened(path) as stream:
            if os.fstat(stream.fileno()).st_size > LARGEST:
                return None
            memory = mmap.mmap(stream.fileno(), 0, mmap.MAP_PRIVATE | mmap.MAP_POPULATE)
        magic, length, check = _HEAD.unpack_from(memory)
        whole = memoryview(memory)
        if magic != _MAGIC or zlib.crc32(whole[_HEAD.size :]) != check:
            return None
        facts = plain_json(whole[_HEAD.size : _HEAD.size + length].tobytes())
        poses, roots, *floor = _taken(memory, _HEAD.size + length, facts["shapes"])
        figure = tuple(facts["joints"]), tuple(facts["parents"])
        shapes = [(len(poses), len(skeleton), 4), (len(poses), 3)]
        if floor:
            shapes += [(sum(map(len, soles_of(skeleton))),), (len(poses),)]
    except (OSError, ValueError, LookupError, ArithmeticError, TypeError, struct.error):
        return None
    if figure != (skeleton.names, tuple(skeleton.parents)) or shapes != [
        array.shape for array in (poses, roots, *floor)
    ]:
        return None
    return Recording(skeleton, poses, roots, FPS), Floor(floor[0], floor[1]) if floor else None


def _arrays(phrase: Recording, floor: Floor | None) -> list[FloatArray]:
    arrays = [phrase.poses, phrase.roots]
    return arrays if floor is None else [*arrays, floor.rest_heights, floor.lifts]


def _taken(memory: mmap.mmap, at: int, shapes: Sequence[Sequence[int]]) -> list[FloatArray]:
    """Arrays that lie one behind the other."""
    arrays: list[FloatArray] = []
    for shape in shapes:
        array = np.frombuffer(memory, np.float32, int(np.prod(shape)), at)
        arrays.append(array.reshape(shape))
        at += array.nbytes
    return arrays
