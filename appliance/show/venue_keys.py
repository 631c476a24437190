"""The keys of box.yaml that a venue changes: what a page shows of them, with their bounds and sentences."""

from __future__ import annotations

from typing import Any, NamedTuple

from pydantic.fields import FieldInfo

from appliance.show import describe
from appliance.show.box import BoxConfig
from appliance.show.section import Section
from appliance.show.yaml_file import Location

KEYS: tuple[Location, ...] = (
    ("sensors", "udp", "host"),
    ("sensors", "udp", "port"),
    ("control", "host"),
    ("control", "port"),
    ("control", "senders"),
    ("console", "host"),
    ("console", "port"),
    ("console", "viewers"),
    ("console", "rehearsal"),
)
_LISTS: tuple[Location, ...] = (("outputs", "osc"), ("outputs", "posistagenet"), ("outputs", "dmx"))
_OF_AN_OUTPUT = ("host", "port", "universe", "device")


class VenueKey(NamedTuple):
    """A key with its value now. kind: text, number, list (of texts) or switch; purpose: what it is for."""

    location: Location
    value: Any
    kind: str
    purpose: str
    within: str


def venue_keys(box: BoxConfig) -> list[VenueKey]:
    """The receivers of this box; of its outputs the ones in its file."""
    found = [one for location in KEYS if (one := _key(box, location)) is not None]
    for name in _LISTS:
        for place, entry in enumerate(_written(box, name)):
            of_this = (_key(box, (*name, place, key)) for key in _OF_AN_OUTPUT if key in entry)
            found += [one for one in of_this if one is not None]
    return found


def _written(box: BoxConfig, name: Location) -> list[dict[str, Any]]:
    """The entries of a list as written in the file; none where it has no such list."""
    values = box.file.at(*name)
    return [entry for entry in values if isinstance(entry, dict)] if isinstance(values, list) else []


def _key(box: BoxConfig, location: Location) -> VenueKey | None:
    section: Any = box
    for step in location[:-1]:
        section = section[step] if isinstance(step, int) else getattr(section, step, None)
        if section is None:
            return None
    name = str(location[-1])
    field: FieldInfo | None = type(section).model_fields.get(name) if isinstance(section, Section) else None
    if field is None:
        return None
    value = getattr(section, name)
    return VenueKey(location, value, _kind(value), str(field.description), describe.bounds(field))


def _kind(value: Any) -> str:
    if isinstance(value, bool):
        return "switch"
    if isinstance(value, int | float):
        return "number"
    return "list" if isinstance(value, list) else "text"
