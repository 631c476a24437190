"""Zip archives with XML from others (GDTF, MVR): read in memory, within bounds; nothing goes to the disk."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from pathlib import PurePosixPath
from typing import BinaryIO
from xml.etree import ElementTree

from appliance.fixture_library.open_fixture_library import LibraryError

LARGEST_XML = 16_000_000  # bytes; a fixture with fifty modes has 3 MB
_MOST_MEMBERS, _LARGEST_DIRECTORY = 10_000, 4_000_000
_MOST_ELEMENTS, _DEEPEST = 200_000, 100
_END = struct.Struct("<4s4H2LH")  # end of central directory, APPNOTE.TXT 4.3.16
_LONGEST_COMMENT = 0xFFFF
_FAULTS = (
    *(zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError),
    *(ValueError, OSError, struct.error),
)


def archive_of(stream: BinaryIO) -> zipfile.ZipFile:
    """The archive in a stream. Raises LibraryError for any other file and for one out of bounds."""
    try:
        _require_small_directory(stream)
        archive = zipfile.ZipFile(stream)
    except LibraryError:
        raise
    except _FAULTS as error:
        raise LibraryError(f"This is not a zip archive ({error}). Download it again.") from error
    for name in archive.namelist():
        path = PurePosixPath(name.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts or ":" in path.parts[:1]:
            raise LibraryError(f"The archive names a file outside itself ('{name[:60]}'). It is not read.")
    return archive


def member(archive: zipfile.ZipFile, name: str, largest: int) -> bytes:
    """One file of the archive. Raises LibraryError above `largest` unpacked bytes, KeyError without it."""
    info = archive.getinfo(name)
    try:
        with archive.open(info) as stream:
            data = stream.read(largest + 1)
    except _FAULTS as error:
        raise LibraryError(f"'{name}' in the archive is damaged ({error}). Download it again.") from error
    if len(data) > largest:
        raise LibraryError(f"'{name}' in the archive is larger than {largest / 1e6:g} MB. It is not read.")
    return data


def xml_of(data: bytes, name: str) -> ElementTree.Element:
    """The root of an XML file in UTF-8. Raises LibraryError for faulty XML, and for entities, too many
    elements or too deep a tree: they cost more time and memory than any fixture.
    """
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise LibraryError(f"'{name}' defines entities, which no fixture needs. It is not read.")
    root: ElementTree.Element | None = None
    depth = count = 0
    try:
        text = data.decode("utf-8-sig").rstrip("\0 \r\n\t")
        for event, element in ElementTree.iterparse(io.StringIO(text), ("start", "end")):
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            count += event == "start"
            if depth > _DEEPEST or count > _MOST_ELEMENTS:
                raise LibraryError(f"'{name}' is nested too deeply or has too many parts. It is not read.")
    except ElementTree.ParseError as error:
        raise LibraryError(f"'{name}' is not XML ({error}). Download it again.") from error
    except UnicodeDecodeError as error:
        raise LibraryError(f"'{name}' is not UTF-8. Download it again.") from error
    if root is None:
        raise LibraryError(f"'{name}' is empty. Download it again.")
    return root


def _require_small_directory(stream: BinaryIO) -> None:
    """A directory of millions of files would fill the memory before its names can be counted."""
    size = stream.seek(0, io.SEEK_END)
    stream.seek(max(0, size - _END.size - _LONGEST_COMMENT))
    tail = stream.read()
    place = len(tail) - _END.size
    if tail[max(place, 0) :][:4] != b"PK\5\6":
        place = tail.rfind(b"PK\5\6")
    if place < 0:
        raise LibraryError("This is not a zip archive. Download it again.")
    _, _, _, _, members, directory, _, _ = _END.unpack_from(tail, place)
    if (
        members > _MOST_MEMBERS
        or directory > _LARGEST_DIRECTORY
        or b"PK\6\7" in tail[max(place - 20, 0) : place]
    ):
        raise LibraryError(f"The archive has more than {_MOST_MEMBERS} files. It is not read.")
    stream.seek(0)
