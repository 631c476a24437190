"""From the plain values of a YAML file to a typed section, or one error that lists all that is wrong."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from appliance.show import describe
from appliance.show.config_error import (
    MOST_PROBLEMS,
    ConfigError,
    Problem,
    did_you_mean,
    nearest,
    shortened,
)
from appliance.show.section import Section
from appliance.show.yaml_file import Location, YamlFile

AnySection = TypeVar("AnySection", bound=Section)


def validated(model: type[AnySection], file: YamlFile, context: dict[str, Any]) -> AnySection:
    """The file as a section; raises ConfigError with every problem's line, message and cure."""
    try:
        return model.model_validate(file.values, context=context)
    except ValidationError as error:
        found = sorted(error.errors(), key=lambda details: file.line(tuple(details["loc"])))
        first, more = found[:MOST_PROBLEMS], max(0, len(found) - MOST_PROBLEMS)
        raise ConfigError([_problem(model, file, details) for details in first], more) from None


def _problem(model: type[Section], file: YamlFile, error: ErrorDetails) -> Problem:
    location: Location = tuple(error["loc"])
    context: dict[str, Any] = error.get("ctx", {})
    if error["type"] == "refused":
        at = context["at"] if context["at"] is not None else ()
        below = at if isinstance(at, tuple) else (at,)
        return file.problem((*location, *below), context["message"], context["cure"])
    return file.problem(location, *_message(model, location, error))


def _message(model: type[Section], location: Location, error: ErrorDetails) -> tuple[str, str]:
    """Message and cure for an error that pydantic found by itself."""
    around = _section_at(model, location[:-1])
    if error["type"] == "extra_forbidden":
        where = f" in '{spoken(location[:-1])}'" if location[:-1] else ""
        return f"Unknown key '{shortened(location[-1])}'{where}.", did_you_mean(
            location[-1], list(describe.keys(around))
        )
    field, name = _field_at(model, location), spoken(location)
    if error["type"] == "missing" and isinstance(location[-1], int):
        wanted = describe.kind(field.annotation) if field else "long enough"
        return f"'{spoken(location[:-1])}' is {_shown(error['input'])}, not {wanted}.", _cure(error, field)
    if error["type"] == "missing":
        description = field.description if field else ""
        return f"The key '{name}' is missing.", f"Add it: {description}" if description else ""
    return f"'{name}' is {_shown(error['input'])}, {_complaint(error, field)}.", _cure(error, field)


def _complaint(error: ErrorDetails, field: FieldInfo | None) -> str:
    if error["type"] in ("too_long", "too_short", "string_too_long", "string_too_short"):
        return "too short or too long"
    if error["type"].startswith(("greater", "less", "finite")):
        return "out of range"
    wanted = (
        "a number" if field is None or isinstance(error["loc"][-1], int) else describe.kind(field.annotation)
    )
    if error["type"] == "literal_error":
        return f"not {wanted}"
    return f"which is not {wanted}"


def _cure(error: ErrorDetails, field: FieldInfo | None) -> str:
    if field is None:
        return ""
    choices, limits = describe.choices(field.annotation), describe.bounds(field)
    if error["type"] == "literal_error" and len(choices) > 1:
        near = nearest(error["input"], choices)  # the message lists them all
        return f"Did you mean '{near}'?" if near else str(field.description or "")
    if isinstance(error["loc"][-1], int):
        limits = _share_of(error)
    if isinstance(error["input"], str) and _is_number(error["input"]):
        return "Write it without quotes and without an exponent (0.001, not 1e-3)."
    if isinstance(error["input"], str) and _is_number(error["input"].replace(",", ".", 1)):
        return f"Write it with a point: {error['input'].replace(',', '.', 1)}."
    return " ".join(part for part in (f"Write {limits}." if limits else "", field.description) if part)


def _share_of(error: ErrorDetails) -> str:
    """Bounds of a number in brackets, as far as they are known: those around it count the entries."""
    limits = error.get("ctx", {})
    if "ge" in limits:
        return f"at least {limits['ge']:g}"
    return f"at most {limits['le']:g}" if "le" in limits else ""


def _section_at(model: type[Section], location: Location) -> type[Section]:
    """The section in which a location stands."""
    for step in location:
        if isinstance(step, str) and (field := describe.keys(model).get(step)) is not None:
            model = describe.section(field.annotation) or model
    return model


def _field_at(model: type[Section], location: Location) -> FieldInfo | None:
    """The field of a key, or of the list or the numbers around a place in brackets."""
    while location and isinstance(location[-1], int):
        location = location[:-1]
    return describe.keys(_section_at(model, location[:-1])).get(str(location[-1])) if location else None


def spoken(location: Location) -> str:
    """('hands', 0, 'joint') as 'hands[0].joint'."""
    text = ""
    for step in location:
        name = shortened(step)
        text += f"[{step}]" if isinstance(step, int) else f".{name}" if text else name
    return text


def _shown(value: object) -> str:
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a group of keys"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
