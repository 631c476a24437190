"""Attributes of GDTF as capabilities of the Open Fixture Library, so that both are given the same meaning.

The attributes: DIN SPEC 15800:2022-02, annex A. Numbers in their names ('Gobo1', 'Gobo2') are left out here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

Json = dict[str, Any]

NO_FEATURE = "NoFeature"
_MOST_DEGREES, _FASTEST = 1440.0, 2000.0  # what a profile takes: degrees, degrees a second
_KINDS = {
    "Dimmer": "Intensity",
    "Pan": "Pan",
    "Tilt": "Tilt",
    "PanRotate": "PanContinuous",
    "TiltRotate": "TiltContinuous",
    "PositionMSpeed": "PanTiltSpeed",
    "StrobeFrequency": "StrobeSpeed",
    "Zoom": "Zoom",
    "Focus": "Focus",
    "Iris": "Iris",
    "Frost": "Frost",
    "CTO": "ColorTemperature",
    "CTC": "ColorTemperature",
    "CTB": "ColorTemperature",
    "Fog": "Fog",
    "Haze": "Fog",
    NO_FEATURE: "NoFunction",
}
_COLOURS = {
    "ColorAdd_R": "red",
    "ColorAdd_G": "green",
    "ColorAdd_B": "blue",
    "ColorAdd_W": "white",
    "ColorRGB_Red": "red",
    "ColorRGB_Green": "green",
    "ColorRGB_Blue": "blue",
    "ColorRGB_Cyan": "cyan",
    "ColorRGB_Magenta": "magenta",
    "ColorRGB_Yellow": "yellow",
    "ColorSub_C": "cyan",
    "ColorSub_M": "magenta",
    "ColorSub_Y": "yellow",
    "ColorAdd_RY": "amber",
    "ColorAdd_GY": "lime",
    "ColorAdd_UV": "uv",
    "ColorAdd_WW": "warm white",
    "ColorAdd_CW": "cold white",
}
_WORDS = {  # 'cyan' alone is a filter in a profile; these lamps add their colour
    "ColorAdd_C": "cyan lamp",
    "ColorAdd_M": "magenta lamp",
    "ColorAdd_Y": "yellow lamp",
    "ColorAdd_BM": "purple",
    "ColorAdd_RM": "pink",
    "ColorAdd_GC": "turquoise",
    "ColorAdd_BC": "light blue",
    "Color": "colour wheel",
    "Gobo": "gobo wheel",
}


def words_of(attribute: str) -> str:
    """An attribute as words: 'gobo wheel pos' for 'Gobo1Pos'."""
    name = _unnumbered(attribute)
    if name in _WORDS:
        return _WORDS[name]
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|_+", " ", name)
    return spaced.casefold().strip() or "channel"


def capabilities_of(attribute: str, function: Any, first: int, last: int, size: int) -> Sequence[Json]:
    """A channel function of the library `pygdtf` on the values first to last of `size` bytes."""
    name = _unnumbered(attribute)
    whole = {"dmxRange": (first, last)}
    start, end = _physical(function)
    if name in _COLOURS:
        return [{**whole, "type": "ColorIntensity", "color": _COLOURS[name]}]
    if name.startswith("Shutter"):
        return _shutter(name, function, first, last, size)
    kind = _KINDS.get(name, name)
    if kind == "Intensity" and start != end:
        return [{**whole, "type": kind, "brightnessStart": f"{start:g}%", "brightnessEnd": f"{end:g}%"}]
    if kind in ("Pan", "Tilt") and has_degrees(function):
        # Drawn hanging, pan turns right-handed about z (up), tilt about x. A profile's pan turns about the
        # axis that points from the base into the room, here down: its sign is the opposite.
        turn = -1.0 if kind == "Pan" else 1.0
        angles = {"angleStart": f"{turn * start}deg", "angleEnd": f"{turn * end}deg"}
        return [{**whole, "type": kind, **angles, "slew": _slew(function)}]
    return [{**whole, "type": kind}]


def has_degrees(function: Any) -> bool:
    """Whether pan or tilt has a range that a profile can hold; where none is written, it is 0 to 1."""
    start, end = _physical(function)
    return 1.0 < abs(end - start) <= _MOST_DEGREES


def middle_of(function: Any) -> float:
    """The middle of its range in physical units."""
    return sum(_physical(function)) / 2


def scaled(value: Any, size: int) -> int:
    """A DMX value of `pygdtf` in `size` bytes: 255/1 is 65535 of two."""
    count = max(int(value.byte_count), 1)
    largest = int(256**count - 1)
    number = min(max(int(value.value), 0), largest)
    if count > size:
        return number >> 8 * (count - size)
    return round(number * int(256**size - 1) / largest)


def _unnumbered(attribute: str) -> str:
    return re.sub(r"\d+", "", attribute)


def _slew(function: Any) -> float | None:
    """Degrees a second; None where the file does not say, or a profile cannot hold it."""
    start, end = _physical(function)
    speed = abs(end - start) / function.real_fade if function.real_fade > 0.0 else 0.0
    return round(speed, 1) if 1.0 <= speed <= _FASTEST else None


def _physical(function: Any) -> tuple[float, float]:
    return float(function.physical_from.value or 0.0), float(function.physical_to.value or 0.0)


def _shutter(name: str, function: Any, first: int, last: int, size: int) -> Sequence[Json]:
    """Its sets one by one: where it is open, closed, or flashes."""
    if name != "Shutter":
        return [{"dmxRange": (first, last), "type": "ShutterStrobe", "shutterEffect": "Strobe"}]
    sets = sorted(function.channel_sets, key=lambda one: scaled(one.dmx_from, size))
    starts = [max(scaled(one.dmx_from, size), first) for one in sets]
    found = []
    for one, start, after in zip(sets, starts, [*starts, last + 1][1:], strict=True):
        said = str(one.name or "").casefold()
        ends = {one.physical_from.value, one.physical_to.value}
        effect = "Open" if "open" in said or ends == {1.0} else "Closed"
        if start < after <= last + 1:
            found.append({"dmxRange": (start, after - 1), "type": "ShutterStrobe", "shutterEffect": effect})
    return found or [{"dmxRange": (first, last), "type": "ShutterStrobe", "shutterEffect": "Open"}]
