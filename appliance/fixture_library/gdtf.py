"""Fixtures in GDTF (DIN SPEC 15800) as profiles; what a profile cannot express is left out and reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, BinaryIO

from appliance.fixture_library import open_fixture_library
from appliance.fixture_library.gdtf_attributes import (
    NO_FEATURE,
    Json,
    capabilities_of,
    has_degrees,
    middle_of,
    scaled,
    words_of,
)
from appliance.fixture_library.gdtf_file import FAULTS, fixture_type, not_a_fixture
from appliance.fixture_library.open_fixture_library import LibraryError

_LONGEST_NAME = 64  # a mode's name in a profile


def profile_values(stream: BinaryIO, wanted: str | None = None) -> tuple[dict[str, Any], list[str]]:
    """A profile as plain values, of all modes or of the wanted one, and sentences about what was left out.

    Raises LibraryError.
    """
    fixture = fixture_type(stream, wanted)
    name = " ".join(str(word) for word in (fixture.manufacturer, fixture.name) if word) or "Fixture"
    listed: list[Json] = []
    specials: dict[str, Json] = {}
    notes: list[str] = []
    for mode in fixture.dmx_modes:
        try:
            values, said = open_fixture_library.profile_values(_Mode(fixture, mode, notes).as_library(name))
        except LibraryError as error:
            notes.append(str(error))
            continue
        except FAULTS as error:
            raise not_a_fixture(error) from error
        own = {special["name"]: special for special in values["attributes"]}
        used = {channel: own.get(channel, {}) for channel in values["modes"][0]["channels"]}
        other = next((word for word in used if specials.get(word, used[word]) != used[word]), None)
        notes.extend(said)
        if other is not None:
            notes.append(
                f"The mode '{mode.name}' uses '{other}' in another way than the modes before it: it is left "
                f"out. Convert it into a second profile: --mode '{mode.name}'."
            )
            continue
        specials.update(used)
        listed += values["modes"]
    if not listed:
        raise LibraryError(" ".join([f"{name} has no mode that fits into a profile.", *notes[:3]]))
    attributes = [special for special in specials.values() if special]
    return {"name": name[:200], "modes": listed, "attributes": attributes}, list(dict.fromkeys(notes))


class _Mode:
    """One mode of a fixture, on its way to the form of the Open Fixture Library."""

    def __init__(self, fixture: Any, mode: Any, notes: list[str]) -> None:
        self._fixture, self._mode, self._notes = fixture, mode, notes
        self._channels = [one for one in mode.dmx_channels if str(one.attribute) != NO_FEATURE]
        self._by_name = {str(one.name): one for one in mode.dmx_channels}

    def as_library(self, name: str) -> Json:
        """A fixture of that library with this mode; raises LibraryError for a mode without channels."""
        keys = self._keys()
        if not keys:
            raise LibraryError(f"The mode '{self._mode.name}' has no channels: it is left out.")
        self._note_unread()
        channels = {
            key: self._channel(key, channel) for key, channel in zip(keys, self._channels, strict=True)
        }
        mode = {"name": str(self._mode.name or "Default")[:_LONGEST_NAME], "channels": self._layout(channels)}
        return {"name": name, "availableChannels": channels, "modes": [mode]}

    def _keys(self) -> list[str]:
        """A name for each channel, numbered where there are several of a kind."""
        words = [words_of(str(channel.attribute)) for channel in self._channels]
        counts, seen, keys = Counter(words), Counter[str](), []
        masters = [place for place, word in enumerate(words) if word == "dimmer" and not self._is_cell(place)]
        for place, word in enumerate(words):
            seen[word] += 1
            key = f"{word} {seen[word]}" if counts[word] > 1 else word
            keys.append("master dimmer" if masters == [place] and counts[word] > 1 else key)
        return keys

    def _is_cell(self, place: int) -> bool:
        found = self._fixture.geometries.get_geometry_by_name(self._channels[place].geometry)
        return type(found).__name__ == "GeometryReference"

    def _layout(self, channels: Mapping[str, Json]) -> list[str | None]:
        """Keys from the first channel on; blocks that are patched one by one follow each other."""
        blocks = sorted({int(channel.dmx_break) for channel in self._channels})
        if len(blocks) > 1:
            self._notes.append(
                f"The mode '{self._mode.name}' has {len(blocks)} start addresses; in the profile the blocks "
                "follow each other."
            )
        layout: list[str | None] = []
        for block in blocks:
            own = [pair for pair in zip(channels, self._channels, strict=True) if pair[1].dmx_break == block]
            places: list[str | None] = [None] * max(max(channel.offset) for _, channel in own)
            for key, channel in own:
                names = [key, *channels[key].get("fineChannelAliases", ())]
                for place, word in zip(channel.offset, names, strict=True):
                    places[place - 1] = word
            layout += places
        return layout

    def _channel(self, key: str, channel: Any) -> Json:
        size = len(channel.offset)
        functions = self._active(key, channel)
        starts = [scaled(function.dmx_from, size) for function in functions]
        ends = [after - 1 for after in [*starts, 256**size][1:]]
        capabilities: list[Json] = []
        for function, first, last in zip(functions, starts, ends, strict=True):
            attribute = str(function.attribute)
            if attribute in ("Pan", "Tilt"):
                self._note_turning(attribute, channel, function)
            if first <= last:
                capabilities += capabilities_of(attribute, function, first, last, size)
        capabilities = capabilities or [{"type": "NoFunction"}]
        found: Json = {"capabilities": capabilities, "defaultValue": scaled(channel.default, size)}
        if size > 1:
            found["fineChannelAliases"] = [f"{key} byte {place}" for place in range(2, size + 1)]
        return found

    def _active(self, key: str, channel: Any) -> list[Any]:
        """Its functions by their first value; of those that another channel chooses, the default ones."""
        functions = [one for logical in channel.logical_channels for one in logical.channel_functions]
        chosen = [one for one in functions if self._is_chosen(one)]
        if len(chosen) < len(functions):
            self._notes.append(f"'{key}' depends on another channel: it is taken as at that one's default.")
        size = len(channel.offset)
        return sorted(chosen or functions[:1], key=lambda one: scaled(one.dmx_from, size))

    def _is_chosen(self, function: Any) -> bool:
        link = getattr(function.mode_master, "str_link", None)
        master = self._by_name.get(str(link).partition(".")[0]) if link else None
        if master is None or not master.offset:
            return True
        size = len(master.offset)
        first, last = scaled(function.mode_from, size), scaled(function.mode_to, size)
        return first <= scaled(master.default, size) <= last

    def _note_turning(self, attribute: str, channel: Any, function: Any) -> None:
        if not has_degrees(function):
            self._notes.append(
                f"{attribute} has no range in degrees there: write `degrees` into the profile."
            )
        elif abs(middle_of(function)) > 1.0:
            self._notes.append(
                f"{attribute} is {middle_of(function):g} degrees in the middle of its range; the box takes "
                "the middle as 0."
            )
        root = self._fixture.geometries.get_geometry_by_name(self._mode.geometry)
        if any(_is_rotated(one) for one in _path(root, channel.geometry)):
            self._notes.append(f"The axis of {attribute} is drawn rotated: it may need `invert`.")

    def _note_unread(self) -> None:
        """Channels on parts below a repeated part, which the library does not reach."""
        root = self._fixture.geometries.get_geometry_by_name(self._mode.geometry)
        reached = {name for one in _all_parts(root) for name in (one.name, getattr(one, "geometry", None))}
        wanted = {one.geometry for one in self._mode._dmx_channels if one.offset}
        if wanted - reached:
            self._notes.append(
                f"The mode '{self._mode.name}' has channels on parts that cannot be reached "
                f"({', '.join(sorted(map(str, wanted - reached))[:5])}): they stay 0."
            )


def _all_parts(part: Any) -> Iterator[Any]:
    if part is not None:
        yield part
        for child in getattr(part, "geometries", ()):
            yield from _all_parts(child)


def _path(part: Any, name: str | None) -> Sequence[Any]:
    """Parts from the root to the named one; [] where it is not below the root."""
    if part is None or part.name == name:
        return [part] if part is not None else []
    paths = (_path(child, name) for child in getattr(part, "geometries", ()))
    below = next((path for path in paths if path), [])
    return [part, *below] if below else []


def _is_rotated(part: Any) -> bool:
    rows = part.position.matrix
    return any(abs(rows[row][column] - (row == column)) > 1e-3 for row in range(3) for column in range(3))
