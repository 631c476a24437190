"""The shelf: shows and box files copied from sticks, whole or not at all, each in its folder."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from appliance.box.durable import new_file, private_folder, write_whole
from appliance.pose.whole_file import exchange, sync
from appliance.release.arrivals import SHOW, Arrival
from appliance.release.choice import Choice, appliance_box
from appliance.show.bundle import WORKSHOP

_CHUNK = 1 << 18
_LARGEST_BYTES = 400_000_000
_LARGEST_BOX_BYTES = 1_000_000
_LEFT_FREE_BYTES = 32_000_000  # on the partition, or in memory: the journal and the place need some
_PART = ".part"


class UnreadableError(Exception):
    """The stick's contents cannot be read to the end; the message names the file."""


class NoRoomError(Exception):
    """The shelf takes no file: it is full, read-only or not there."""


class Shelf:
    """Shows in `shows/<id>/`, box files in `boxes/<id>.yaml`; an id is of the content."""

    def __init__(self, root: Path) -> None:
        self._root = root

    def take_show(self, arrival: Arrival) -> tuple[str, Path]:
        """Copy a show bundle; its id and place. Raises UnreadableError, NoRoomError; then nothing is left."""
        names = [
            (name.removeprefix(f"{SHOW}/"), size)
            for name, size, _ in arrival.listing
            if name.startswith(f"{SHOW}/") and name.split("/")[1] not in WORKSHOP
        ]
        total = sum(size for _, size in names)
        if total > _LARGEST_BYTES:
            raise UnreadableError(f"{arrival.show}: {total / 1e6:.0f} MB are more than a show can have.")
        shows = self._root / "shows"
        part = shows / f"{_PART}-{os.getpid()}"
        try:
            with _writing():
                self._require_room(shows, total)
                part.mkdir(mode=0o700)
            identity = _copy_files(arrival.folder / SHOW, part, names)
            with _writing():
                return identity, _put(part, shows / identity)
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def take_box(self, arrival: Arrival) -> tuple[str, Path]:
        """Keep a box file as it is, for the check; its id and place. Raises as take_show does."""
        try:
            with (arrival.folder / "box.yaml").open("rb") as stream:
                content = stream.read(_LARGEST_BOX_BYTES)
        except OSError as error:
            raise _unreadable(arrival.folder / "box.yaml", error) from error
        identity = hashlib.sha256(content).hexdigest()[:12]
        boxes = self._root / "boxes"
        with _writing():
            self._require_room(boxes, len(content))
            path = boxes / f"{identity}.original.yaml"
            write_whole(path, content)
        return identity, path

    def furnish(self, original: Path, places: dict[str, str]) -> Path:
        """The box file that the box runs on: a sound one of a venue, over what a box has built in.

        `places`: where that stands instead of in the usual folders. Raises NoRoomError.
        """
        import yaml

        from appliance.pose.foreign_yaml import plain_values

        built_in = yaml.safe_load(appliance_box(places))
        said = plain_values(original.read_text(encoding="utf-8-sig")) or {}
        text = yaml.safe_dump(
            _over(said, built_in) | {"runtime": built_in["runtime"]}, sort_keys=False, allow_unicode=True
        )
        head = (
            f"# {original.name}; what it leaves out is as a box has it built in. Written by the preflight.\n"
        )
        path = original.with_name(original.name.replace(".original.yaml", ".yaml"))
        with _writing():
            write_whole(path, (head + text).encode())
        return path

    def sweep(self, choices: Iterable[Choice]) -> None:
        """Remove what no pair of these needs any more, and what an interrupted copy has left."""
        pairs = [pair for choice in choices for pair in choice.pairs]
        kept = {place for pair in pairs for place in (pair.show, pair.box)}
        kept |= {pair.box.with_suffix(".original.yaml") for pair in pairs}
        for kind in ("shows", "boxes"):
            with contextlib.suppress(OSError):
                for found in (self._root / kind).iterdir():
                    if found not in kept:
                        _remove(found)

    def _require_room(self, folder: Path, needed: int) -> None:
        private_folder(folder)
        free = os.statvfs(folder)
        if free.f_bavail * free.f_frsize < needed + _LEFT_FREE_BYTES:
            raise NoRoomError(f"{folder}: {needed / 1e6:.1f} MB do not fit there")


def _copy_files(source: Path, target: Path, names: list[tuple[str, int]]) -> str:
    """Each file read once, hashed while it is read, and on the disk at the end; gives the content's id."""
    whole = hashlib.sha256()
    folders = {target}
    for name, size in names:
        with _writing():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            folders.add((target / name).parent)
        digest = hashlib.sha256()
        with _reading(source / name) as reading:
            try:
                with new_file(target / name) as writing:
                    copied = _copy(reading, writing, digest, source / name, size)
            except OSError as error:
                raise NoRoomError(f"{target}: {error.strerror}") from error
        if copied != size:
            ends = f"ends after {copied}" if copied < size else "goes on after all"
            raise UnreadableError(f"{source / name} {ends} of {size} bytes.")
        whole.update(os.fsencode(f"{name}\0{digest.hexdigest()}\n"))
    with _writing():
        for folder in folders:
            sync(folder)
    return whole.hexdigest()[:16]


def _copy(reading: BinaryIO, writing: BinaryIO, digest: Any, source: Path, size: int) -> int:
    """As much as the file was said to have, and some more where it goes on; gives how much."""
    copied = 0
    while copied <= size:
        try:
            chunk = reading.read(_CHUNK)
        except OSError as error:
            raise _unreadable(source, error) from error
        if not chunk:
            return copied
        digest.update(chunk)
        writing.write(chunk)
        copied += len(chunk)
    return copied


def _remove(found: Path) -> None:
    """Removes anything; an entry that cannot be removed stays, and holds up nothing else."""
    with contextlib.suppress(OSError):
        if found.is_dir() and not found.is_symlink():
            shutil.rmtree(found, ignore_errors=True)
        else:
            found.unlink()


def _put(part: Path, place: Path) -> Path:
    """Moves the copy into place; an existing one, whose disk may have damaged it, takes its place."""
    if place.exists():
        exchange(part, place)
    else:
        part.rename(place)
        sync(place.parent)
    return place


def _over(said: Any, built_in: Any) -> Any:
    """The venue's value, or the built-in one for keys that it leaves out."""
    if not (isinstance(said, dict) and isinstance(built_in, dict)):
        return said
    return {**built_in, **{key: _over(value, built_in.get(key)) for key, value in said.items()}}


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[BinaryIO]:
    try:
        stream = path.open("rb")
    except OSError as error:
        raise _unreadable(path, error) from error
    with stream:
        yield stream


@contextlib.contextmanager
def _writing() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise NoRoomError(f"{error.filename or 'the disk'}: {error.strerror}") from error


def _unreadable(path: Path, error: OSError) -> UnreadableError:
    return UnreadableError(f"{path} cannot be read ({error.strerror}).")
