"""Fixtures of the Open Fixture Library (JSON) as profiles: modes, matrices, fine and switching channels.

The format: docs/fixture-format.md of that library. Anything that a profile cannot express is left out and
reported.
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from appliance.fixture_library.attribute_meaning import capabilities_of, meaning_of
from appliance.show.fixture_profile import DIMMER, FINE, MAX_CHANNELS, UNUSED

Json = Mapping[str, Any]


class LibraryError(ValueError):
    """A file that is no fixture of the library; the message says why and what to do."""


def missing_mode(wanted: str, names: Sequence[str]) -> LibraryError:
    """The error for a mode that the fixture does not have; it lists the modes."""
    has = f"It has: {', '.join(names[:20])}." if names else "It has none."
    return LibraryError(f"There is no mode '{wanted}'. {has}")


def profile_values(fixture: Json, wanted: str | None = None) -> tuple[dict[str, Any], list[str]]:
    """A profile as plain values, of all modes or of the wanted one, and sentences about what was left out.

    Raises LibraryError.
    """
    if "redirectTo" in fixture:
        raise LibraryError(
            f"This file only says that the fixture is now called {fixture['redirectTo']}. Convert that one."
        )
    try:
        values, notes = _Conversion(fixture if wanted is None else _of_mode(fixture, wanted)).result()
    except LibraryError:
        raise
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise LibraryError(
            f"This is not a fixture of the Open Fixture Library ({type(error).__name__}: {error}). "
            "Download it again as JSON ('Open Fixture Library JSON')."
        ) from error
    if not values["modes"]:
        raise LibraryError(f"No mode of {values['name']} fits into one universe.")
    return values, notes


class _Conversion:
    def __init__(self, fixture: Json) -> None:
        self._fixture = fixture
        self._notes: list[str] = []
        self._channels = _all_channels(fixture)
        self._bytes = {
            alias: (key, place)
            for key, channel in self._channels.items()
            for place, alias in enumerate(channel.get("fineChannelAliases", ()), 1)
        }
        self._meanings = {key: meaning_of(key, channel, fixture) for key, channel in self._channels.items()}

    def result(self) -> tuple[dict[str, Any], list[str]]:
        modes = {_mode_name(mode): self._keys(mode) for mode in self._fixture["modes"]}
        names = self._names(list(modes.values()))
        listed, used = [], {}
        for mode, keys in modes.items():
            if len(keys) > MAX_CHANNELS:
                self._note(
                    f"The mode '{mode}' has {len(keys)} channels, more than a universe: it is left out."
                )
                continue
            channels = [self._channel(key, keys, names) for key in keys]
            listed.append({"name": mode, "channels": channels})
            used.update(
                {names[key]: self._meanings[key] for key in keys if key in names and names[key] in channels}
            )
        special = [{"name": name, **meaning.special} for name, meaning in used.items() if meaning.special]
        return {"name": str(self._fixture["name"]), "modes": listed, "attributes": special}, self._notes

    def _keys(self, mode: Json) -> list[str]:
        """A mode's channels as keys of `_channels` or of their finer bytes; '-' for none."""
        blocks = (
            _inserted(entry, self._fixture) if isinstance(entry, Mapping) else [entry]
            for entry in mode["channels"]
        )
        return [self._switched(key) for block in blocks for key in block]

    def _switched(self, key: str | None) -> str:
        """The key itself, or the one that a switching channel stands for at the trigger's default."""
        if key is None:
            return UNUSED
        if key in self._channels or key in self._bytes:
            return key
        for trigger, channel in self._channels.items():
            for capability in _by_default(channel):
                if key in capability.get("switchChannels", {}):
                    chosen = str(capability["switchChannels"][key])
                    self._note(f"'{key}' depends on '{trigger}': it is taken as '{chosen}'.")
                    return chosen
        raise KeyError(key)

    def _names(self, modes: Sequence[Sequence[str]]) -> dict[str, str]:
        """An attribute's name for each channel; numbered where a mode has several of a kind."""
        names: dict[str, str] = {}
        sets = [set(mode) for mode in modes]
        for kind in dict.fromkeys(meaning.name for meaning in self._meanings.values()):
            keys = [key for key, meaning in self._meanings.items() if meaning.name == kind]
            together = [[key for key in keys if key in mode] for mode in sets]
            for group in _joined([group for group in together if len(group) > 1]):
                masters = self._masters(group) if kind == DIMMER else []
                numbered = [key for key in keys if key in group and key not in masters]
                names.update({key: f"{kind} {number}" for number, key in enumerate(numbered, 1)})
            names.update({key: kind for key in keys if key not in names})
        return names

    def _masters(self, dimmers: Collection[str]) -> list[str]:
        """The one of several dimmers that is above the others: no pixel's, or called so."""
        templates = self._fixture.get("templateChannels", {})
        own = [key for key in dimmers if key in self._fixture.get("availableChannels", {})]
        called = [key for key in own if "master" in key.casefold()]
        if len(called) == 1:
            return called
        return own if len(own) == 1 and templates else []

    def _channel(self, key: str, keys: Sequence[str], names: Mapping[str, str]) -> str:
        """The profile's entry for one channel of a mode."""
        if key == UNUSED or (key in self._meanings and self._meanings[key].name == UNUSED):
            return UNUSED
        if key in names:
            return names[key]
        coarse, place = self._bytes[key]
        if coarse not in keys or place > len(FINE):
            self._note(f"'{key}' stands alone or is too fine: its channel stays 0.")
            return UNUSED
        return names[coarse] + FINE[place - 1]

    def _note(self, sentence: str) -> None:
        if sentence not in self._notes:
            self._notes.append(sentence)


def _mode_name(mode: Json) -> str:
    return str(mode.get("shortName") or mode["name"])


def _of_mode(fixture: Json, wanted: str) -> Json:
    """The fixture with this mode only."""
    found = [mode for mode in fixture["modes"] if wanted in (_mode_name(mode), mode["name"])]
    if not found:
        raise missing_mode(wanted, [_mode_name(mode) for mode in fixture["modes"]])
    return {**fixture, "modes": found[:1]}


def _joined(groups: Sequence[Sequence[str]]) -> list[set[str]]:
    """Groups that share a key become one."""
    joined: list[set[str]] = []
    for group in groups:
        touched = [one for one in joined if one & set(group)]
        joined = [one for one in joined if one not in touched] + [set(group).union(*touched)]
    return joined


def _all_channels(fixture: Json) -> dict[str, Json]:
    """Channels by key: those of each pixel and pixel group, and over them those that are named."""
    channels: dict[str, Json] = {}
    for key, channel in fixture.get("templateChannels", {}).items():
        for pixel in (*_pixels(fixture), *fixture.get("matrix", {}).get("pixelGroups", {})):
            own = json.dumps(channel).replace("$pixelKey", json.dumps(pixel)[1:-1])
            channels[key.replace("$pixelKey", pixel)] = json.loads(own)
    return {**channels, **fixture.get("availableChannels", {})}


def _pixels(fixture: Json) -> list[str]:
    """Keys of all pixels, like reading a book: x first, then y, then z."""
    matrix = fixture.get("matrix", {})
    if "pixelKeys" in matrix:
        return [key for layer in matrix["pixelKeys"] for row in layer for key in row if key is not None]
    if "pixelCount" not in matrix:
        return []
    across, down, deep = matrix["pixelCount"]
    places = [
        (x, y, z)
        for z, y, x in itertools.product(range(1, deep + 1), range(1, down + 1), range(1, across + 1))
    ]
    return [_pixel_key(place, (across, down, deep)) for place in places]


def _pixel_key(place: Sequence[int], count: Sequence[int]) -> str:
    """The library's name of a pixel: a number in a row, (x, y) in a plane, (x, y, z) in space."""
    used = [part for part, size in zip(place, count, strict=True) if size > 1]
    if len(used) == 1:
        return str(used[0])
    if not used:
        return "1"
    return f"({', '.join(map(str, place if len(used) == 3 else used))})"


def _inserted(entry: Json, fixture: Json) -> Iterator[str | None]:
    """The channels that a block of a mode stands for."""
    pixels, templates = _repeated(entry["repeatFor"], fixture), entry["templateChannels"]
    if entry["channelOrder"] == "perPixel":
        pairs = [(template, pixel) for pixel in pixels for template in templates]
    else:
        pairs = [(template, pixel) for template in templates for pixel in pixels]
    for template, pixel in pairs:
        yield None if template is None else template.replace("$pixelKey", pixel)


def _repeated(repeat_for: str | Sequence[str], fixture: Json) -> Sequence[str]:
    if not isinstance(repeat_for, str):
        return repeat_for
    if repeat_for == "eachPixelGroup":
        return list(fixture["matrix"]["pixelGroups"])
    pixels = _pixels(fixture)
    if repeat_for == "eachPixelABC":
        return sorted(pixels, key=_as_people_sort)
    order = repeat_for.removeprefix("eachPixel")
    places = _places(fixture)
    return sorted(pixels, key=lambda pixel: [places[pixel]["XYZ".index(axis)] for axis in reversed(order)])


def _places(fixture: Json) -> dict[str, tuple[int, int, int]]:
    """(x, y, z) of each pixel."""
    matrix = fixture["matrix"]
    if "pixelKeys" in matrix:
        return {
            key: (x, y, z)
            for z, layer in enumerate(matrix["pixelKeys"])
            for y, row in enumerate(layer)
            for x, key in enumerate(row)
            if key is not None
        }
    across, down, deep = matrix["pixelCount"]
    grid = itertools.product(range(deep), range(down), range(across))
    return dict(zip(_pixels(fixture), ((x, y, z) for z, y, x in grid), strict=True))


def _as_people_sort(word: str) -> list[tuple[int, int, str]]:
    """1, 2, 10 instead of 1, 10, 2."""
    parts = re.split(r"(\d+)", word)
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in parts if part]


def _by_default(channel: Json) -> list[Json]:
    """Its capabilities, the one at its default value first."""
    capabilities = list(capabilities_of(channel))
    default = channel.get("defaultValue", 0)
    if not isinstance(default, int):
        return capabilities

    def is_elsewhere(capability: Json) -> bool:
        first, last = capability.get("dmxRange", (0, default))
        return not first <= default <= last

    return sorted(capabilities, key=is_elsewhere)
