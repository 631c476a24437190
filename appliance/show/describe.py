"""Configuration in words: the kind of a value, its bounds, the section behind a key."""

from __future__ import annotations

import types
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic.fields import FieldInfo

from appliance.show.section import Section

_PLAIN = {int: "a whole number", float: "a number", bool: "true or false", str: "text", Path: "a file name"}


def kind(annotation: Any) -> str:
    """'a whole number', 'one of joint, vmc', '4 numbers in brackets', ... for a field's annotation."""
    parts = [part for part in _flat(annotation) if part is not type(None)]
    kinds = " or ".join(_one_kind(part) for part in parts)
    return f"{kinds} or null" if type(None) in _flat(annotation) else kinds


def bounds(field: FieldInfo) -> str:
    """'1 to 64', 'more than 0', 'at most 8 entries', or '' where nothing bounds the value."""
    limits: dict[str, Any] = {}
    for part in (field, *_field_infos(field.annotation)):
        for rule in part.metadata:
            for name in ("ge", "gt", "le", "lt", "min_length", "max_length"):
                if isinstance(rule, annotated_types.BaseMetadata) and hasattr(rule, name):
                    limits[name] = getattr(rule, name)
    if "min_length" in limits or "max_length" in limits:
        return _length_bounds(limits, field)
    low = str(limits["ge"]) if "ge" in limits else f"more than {limits['gt']}" if "gt" in limits else ""
    high = str(limits["le"]) if "le" in limits else ""
    if low and high:
        return f"{low} to {high}" if "ge" in limits else f"{low}, at most {high}"
    return f"at most {high}" if high else f"at least {low}" if "ge" in limits else low


def keys(model: type[Section]) -> dict[str, FieldInfo]:
    """The keys of a section as a file has them."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def section(annotation: Any) -> type[Section] | None:
    """The section that a key opens: itself, in a list, or in place of null; None for a plain value."""
    for part in _flat(annotation):
        if get_origin(part) is list:
            return section(get_args(part)[0])
        if isinstance(part, type) and issubclass(part, Section):
            return part
    return None


def choices(annotation: Any) -> tuple[str, ...]:
    """The words that a key with a fixed choice takes."""
    return tuple(
        str(word) for part in _flat(annotation) if get_origin(part) is Literal for word in get_args(part)
    )


def is_list(annotation: Any) -> bool:
    """Whether a key takes a list of entries."""
    return any(get_origin(part) is list for part in _flat(annotation))


def _flat(annotation: Any) -> list[Any]:
    """The alternatives of an annotation, without Annotated wrappings."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return _flat(get_args(annotation)[0])
    if origin in (Union, types.UnionType):
        return [part for alternative in get_args(annotation) for part in _flat(alternative)]
    return [annotation]


def _one_kind(annotation: Any) -> str:
    if get_origin(annotation) is Literal:
        words = ["true" if word is True else str(word) for word in get_args(annotation)]
        return words[0] if len(words) == 1 else f"one of {', '.join(words)}"
    if get_origin(annotation) is tuple:
        parts = get_args(annotation)
        if parts == (float,) * 4:
            return "an orientation: 4 numbers in brackets, or degrees"
        what = "words" if get_origin(parts[0]) is Literal else "numbers"
        return f"{len(parts)} {what} in brackets"
    if get_origin(annotation) is list:
        return "a list"
    if get_origin(annotation) is dict:
        return f"a group of names, each with {kind(get_args(annotation)[1])}"
    return _PLAIN.get(annotation, "a group of keys")


def _field_infos(annotation: Any) -> list[FieldInfo]:
    """Bounds that stand inside Annotated types."""
    if get_origin(annotation) in (Union, types.UnionType):
        return [info for part in get_args(annotation) for info in _field_infos(part)]
    if get_origin(annotation) is Annotated:
        return [extra for extra in get_args(annotation)[1:] if isinstance(extra, FieldInfo)]
    return []


def _length_bounds(limits: dict[str, Any], field: FieldInfo) -> str:
    has_entries = any(get_origin(part) in (list, dict) for part in _flat(field.annotation))
    unit = "entries" if has_entries else "characters"
    low, high = limits.get("min_length", 0), limits.get("max_length")
    if high is None:
        return "not empty"
    return f"{low} to {high} {unit}" if low else f"at most {high} {unit}"
