"""Meaning of a channel of the Open Fixture Library: its attribute's name and its special properties."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from appliance.show.fixture_profile import COLOURS, DIMMER, FINE, LAMPS, PAN, TILT, UNUSED

Json = Mapping[str, Any]

SHUTTER = "shutter"
_NAMES = {
    "Intensity": DIMMER,
    "Pan": PAN,
    "Tilt": TILT,
    "PanContinuous": "pan rotation",
    "TiltContinuous": "tilt rotation",
    "PanTiltSpeed": "pan tilt speed",
    "ShutterStrobe": SHUTTER,
    "StrobeSpeed": "strobe speed",
    "Zoom": "zoom",
    "Focus": "focus",
    "Iris": "iris",
    "Frost": "frost",
    "ColorTemperature": "colour temperature",
    "Fog": "fog",
    "FogOutput": "fog",
}
_SLIDING = (
    *("Intensity", "ColorIntensity", "Pan", "Tilt", "Zoom", "Focus", "Iris", "Frost", "ColorTemperature"),
    *("BeamAngle", "BeamPosition", "Fog", "FogOutput"),
)
_LONGEST = 60  # characters of a name, with room for a number


@dataclass(frozen=True)
class Meaning:
    """An attribute: its name ('-': none), and its keys in a profile where they are not the defaults."""

    name: str
    special: dict[str, Any] = field(default_factory=dict)


def meaning_of(key: str, channel: Json, fixture: Json) -> Meaning:
    """The main function of the channel with this key."""
    largest = _largest(channel)
    capabilities = [_in_bytes(capability, largest) for capability in capabilities_of(channel)]
    kind = _leading_kind(capabilities)
    if kind is None:
        return Meaning(UNUSED)
    leading = max((one for one in capabilities if one["type"] == kind), key=_width)
    name = _name(key, kind, leading)
    special: dict[str, Any] = {}
    limits = _limits(name, leading, capabilities)
    if name in (DIMMER, PAN, TILT) and _width(leading) > 0 and limits != (0, 255):
        special["limits"] = list(limits)
    if name in (PAN, TILT):
        special.update(_turning(name, leading, fixture))
        if leading.get("slew"):  # from GDTF; the Open Fixture Library has no speeds in degrees
            special["slew"] = float(leading["slew"])
    elif kind == "Intensity" and _is_falling(leading):
        special["invert"] = True
    default = _default(name, channel, capabilities, largest)
    if default:
        special["default"] = default
    if kind in ("Fog", "FogOutput"):
        special["dims"] = True
    if kind not in _SLIDING:
        special["snap"] = True
    return Meaning(name, special)


def capabilities_of(channel: Json) -> Sequence[Json]:
    """A channel's function in parts of its range, or in all of it."""
    return channel.get("capabilities") or [channel["capability"]]


def _largest(channel: Json) -> int:
    """The largest value in which the channel's ranges and defaults are written."""
    resolution = str(channel.get("dmxValueResolution", ""))
    count = (
        int(resolution.removesuffix("bit")) // 8
        if resolution
        else 1 + len(channel.get("fineChannelAliases", ()))
    )
    return int(256**count - 1)


def _in_bytes(capability: Json, largest: int) -> Json:
    """The capability with its range in values of the coarse byte."""
    first, last = capability.get("dmxRange", (0, largest))
    step = (largest + 1) // 256
    return {**capability, "dmxRange": (first // step, last // step)}


def _width(capability: Json) -> int:
    return int(capability["dmxRange"][1] - capability["dmxRange"][0])


def _leading_kind(capabilities: Sequence[Json]) -> str | None:
    """The function of most of the channel, a dimmer before everything else; None: nothing."""
    widths: Counter[str] = Counter()
    for capability in capabilities:
        if capability["type"] != "NoFunction":
            widths[capability["type"]] += _width(capability) + 1
    for kind in ("Pan", "Tilt", "Intensity", "ColorIntensity"):
        if widths[kind] >= 64:
            return kind
    return widths.most_common(1)[0][0] if widths else None


def _name(key: str, kind: str, leading: Json) -> str:
    if kind == "ColorIntensity":
        return str(leading["color"]).casefold()
    if kind in _NAMES:
        return _NAMES[kind]
    name = key.casefold().strip()[:_LONGEST].strip() or "channel"
    word = name.rpartition(" ")[0] if name.rpartition(" ")[2].isdigit() else name
    if name.endswith(FINE) or name == UNUSED or word in (DIMMER, PAN, TILT, *COLOURS, *LAMPS):
        return f"{name} control"  # these words mean something else here
    return name


def _turning(name: str, leading: Json, fixture: Json) -> dict[str, Any]:
    """Range in degrees, and whether the channel runs the other way."""
    angles = [_degrees(leading.get(end, leading.get("angle"))) for end in ("angleStart", "angleEnd")]
    if angles[0] is not None and angles[1] is not None and angles[0] != angles[1]:
        turned = {"degrees": float(abs(angles[1] - angles[0]))}
        return {**turned, "invert": True} if angles[1] < angles[0] else turned
    most = fixture.get("physical", {}).get("focus", {}).get(f"{name}Max")
    return {"degrees": float(most)} if isinstance(most, int | float) and most > 0 else {}


def _degrees(angle: object) -> float | None:
    return float(angle.removesuffix("deg")) if isinstance(angle, str) and angle.endswith("deg") else None


def _limits(name: str, leading: Json, capabilities: Sequence[Json]) -> tuple[int, int]:
    """The part of the channel that is used; a dimmer that only begins to glow there is off at 0."""
    first, last = leading["dmxRange"]
    if name == DIMMER and 0.0 < _brightness(leading)[0] < _brightness(leading)[1]:
        lowest = min(capabilities, key=lambda one: one["dmxRange"][0])
        if lowest.get("brightness") == "off" or lowest.get("shutterEffect") == "Closed":
            first = 0
    return first, last


def _is_falling(leading: Json) -> bool:
    start, end = _brightness(leading)
    return start > end


def _brightness(leading: Json) -> tuple[float, float]:
    """How bright a dimmer is at the start and at the end of its range, percent."""
    words = {"off": 0.0, "dark": 1.0, "bright": 100.0}
    ends = [leading.get("brightnessStart", "off"), leading.get("brightnessEnd", "bright")]
    start, end = (words[end] if end in words else float(str(end).rstrip("%lm")) for end in ends)
    return start, end


def _default(name: str, channel: Json, capabilities: Sequence[Json], largest: int) -> float:
    """Its default, share of its range; 0 if it needs no mention."""
    if name in (DIMMER, PAN, TILT, *COLOURS, *LAMPS):
        return 0.0
    if name == SHUTTER:
        is_open = [one for one in capabilities if one.get("shutterEffect") == "Open"]
        if is_open:
            return round(sum(max(is_open, key=_width)["dmxRange"]) / 2 / 255, 4)
    default = channel.get("defaultValue", 0)
    if isinstance(default, str):
        return round(min(max(float(default.rstrip("%")) / 100, 0.0), 1.0), 4)
    return round(min(float(default) / largest, 1.0), 4)
