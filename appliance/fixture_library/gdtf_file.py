"""Files in GDTF (DIN SPEC 15800), read by `pygdtf` after a check that nothing makes it run for long."""

from __future__ import annotations

import io
from collections import Counter, defaultdict
from typing import Any, BinaryIO
from xml.etree import ElementTree

from appliance.fixture_library.foreign_archive import LARGEST_XML, archive_of, member, xml_of
from appliance.fixture_library.open_fixture_library import LibraryError, missing_mode

MISSING = "GDTF and MVR need two more libraries: pip install 'bunraku[gdtf]'."
FAULTS = (  # raised by the libraries for files that break the standard
    *(KeyError, TypeError, AttributeError, IndexError, ValueError, AssertionError),
    *(RecursionError, OverflowError, ZeroDivisionError),
)
_DESCRIPTION = "description.xml"
_FARTHEST, _MOST_BREAKS, _MOST_CHANNELS, _MOST_ADDRESSES = 4096, 64, 10_000, 100_000
_LARGEST_SIZE = 4  # bytes of a channel
_VALUES = ("DMXFrom", "Default", "Highlight", "ModeFrom", "ModeTo")


def fixture_type(stream: BinaryIO, wanted: str | None = None) -> Any:
    """The fixture as `pygdtf.FixtureType`, with all its modes or the wanted one. Raises LibraryError."""
    root = _description(stream)
    if wanted is not None:
        _drop_other_modes(root, wanted)
    _require_few_channels(root)
    _settle_overwritten_breaks(root)
    return _parsed(root)


def not_a_fixture(error: Exception) -> LibraryError:
    """The error for a file on which a library failed."""
    return LibraryError(
        f"This is not a fixture in GDTF ({type(error).__name__}: {str(error)[:100]}). Download it again."
    )


def _description(stream: BinaryIO) -> ElementTree.Element:
    """The description in an archive, its values without the mark 's', which `pygdtf` does not read."""
    with archive_of(stream) as archive:
        try:
            data = member(archive, _DESCRIPTION, LARGEST_XML)
        except KeyError:
            raise LibraryError(f"The archive has no '{_DESCRIPTION}': it is not a GDTF file.") from None
    root = xml_of(data, _DESCRIPTION)
    for element in root.iter():
        for name in _VALUES:
            value = element.get(name)
            if value is not None and "/" in value:
                number, size = value.rstrip("s ").split("/")[:2]
                _require(size, _LARGEST_SIZE, name)
                element.set(name, f"{number}/{size}")
    return root


def _require_few_channels(root: ElementTree.Element) -> None:
    """Raises LibraryError for offsets and numbers of channels on which `pygdtf` would work for minutes."""
    farthest = 1
    for one in root.iter("Break"):
        _require(one.get("DMXBreak", "1"), _MOST_BREAKS, "DMXBreak")
        farthest = max(
            farthest, _require(one.get("DMXOffset", "1").rpartition(".")[2], _FARTHEST, "DMXOffset")
        )
    channels: Counter[str | None] = Counter()
    addresses = 0
    for mode in root.iter("DMXMode"):
        last = 0
        for channel in mode.iter("DMXChannel"):
            channels[channel.get("Geometry")] += 1
            offset = channel.get("Offset") or "None"
            parts = [] if offset == "None" else offset.split(",")
            if len(parts) > _LARGEST_SIZE:
                raise LibraryError(f"A channel of {len(parts)} bytes cannot be read.")
            last = max([last, *(_require(part, _FARTHEST, "Offset") for part in parts)])
            if channel.get("DMXBreak", "1") != "Overwrite":
                _require(channel.get("DMXBreak", "1"), _MOST_BREAKS, "DMXBreak")
        addresses += last + farthest
    repeated = sum(channels[one.get("Geometry")] for one in root.iter("GeometryReference"))
    if channels.total() + repeated > _MOST_CHANNELS or addresses > _MOST_ADDRESSES:
        raise LibraryError("The fixture has more channels than can be read. Convert one mode: --mode.")


def _settle_overwritten_breaks(root: ElementTree.Element) -> None:
    """Write the break of the references to a part in place of 'Overwrite': pygdtf 1.4.5 takes it as 1."""
    breaks: defaultdict[str | None, set[str]] = defaultdict(set)
    for reference in root.iter("GeometryReference"):
        for last in reference.findall("Break")[-1:]:
            breaks[reference.get("Geometry")].add(last.get("DMXBreak", "1"))
    for channel in root.iter("DMXChannel"):
        own = breaks[channel.get("Geometry")]
        if channel.get("DMXBreak") == "Overwrite" and len(own) == 1:
            channel.set("DMXBreak", next(iter(own)))


def _require(text: str, most: int, name: str) -> int:
    if not text.strip().isdecimal() or not 1 <= int(text[:12]) <= most:
        raise LibraryError(f"'{name}' is {text[:20]!r}, not a number from 1 to {most}.")
    return int(text)


def _drop_other_modes(root: ElementTree.Element, wanted: str) -> None:
    modes = root.find("FixtureType/DMXModes")
    names = [str(mode.get("Name")) for mode in modes] if modes is not None else []
    if modes is None or wanted not in names:
        raise missing_mode(wanted, names)
    for mode in [mode for mode in modes if mode.get("Name") != wanted]:
        modes.remove(mode)


def _parsed(root: ElementTree.Element) -> Any:
    """The fixture as `pygdtf` reads it."""
    try:
        import pygdtf
    except ImportError:
        raise LibraryError(MISSING) from None
    if root.find("FixtureType") is None:
        raise LibraryError(f"'{_DESCRIPTION}' has no FixtureType: it is not a GDTF file.")
    try:
        return pygdtf.FixtureType(dsc_file=io.BytesIO(ElementTree.tostring(root)))
    except FAULTS as error:
        raise not_a_fixture(error) from error
