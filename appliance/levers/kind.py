"""Kinds of values that a lever may have, and how each is written in messages, cues and files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from appliance.levers.form import Number

T = TypeVar("T")

Formatted = tuple[str, tuple[float, ...]]  # a text and numbers, as messages and the journal have them


@dataclass(frozen=True, slots=True)
class Kind(Generic[T]):
    """One kind of value.

    given: the value in a message's text and numbers; formatted: the other way round. plain: the value in a
    cue or in a file, raises ValueError or TypeError. text, numbers, optional: as in a Form.
    """

    given: Callable[[str, Sequence[float]], T]
    formatted: Callable[[T], Formatted]
    plain: Callable[[Any], T]
    text: str = ""
    numbers: tuple[Number, ...] = ()
    optional: int = 0


def name(what: str, none: str | None = None) -> Kind[str]:
    """A name that the show knows; `none`: the word for no name at all, which is the empty text."""

    def known(text: Any) -> str:
        if not isinstance(text, str):
            raise TypeError(f"{text!r} is no name")
        return "" if text == none else text

    return Kind(lambda text, _: known(text), lambda value: (value, ()), known, what)


def number(what: str, least: float, most: float) -> Kind[float]:
    """A number within bounds."""
    own = Number(what, least, most)
    return Kind(lambda _, numbers: float(numbers[0]), lambda value: ("", (value,)), float, numbers=(own,))


def whole(what: str, least: int, most: int) -> Kind[int]:
    """A whole number within bounds."""
    own = Number(what, least, most, is_whole=True)
    return Kind(lambda _, numbers: int(numbers[0]), lambda value: ("", (float(value),)), int, numbers=(own,))


def switch(text: str = "") -> Kind[bool]:
    """On or off; text: what it is about, in a message."""
    own = Number("0 or 1", 0, 1, is_whole=True)
    return Kind(
        *(lambda _, numbers: bool(numbers[0]), lambda value: ("", (float(value),)), bool),
        text=text,
        numbers=(own,),
    )


def pair(first: Number, second: Number) -> Kind[tuple[int, int]]:
    """Two whole numbers."""

    def both(given: Sequence[Any]) -> tuple[int, int]:
        return int(given[0]), int(given[1])

    return Kind(
        lambda _, numbers: both(numbers),
        lambda value: ("", (float(value[0]), float(value[1]))),
        both,
        numbers=(first, second),
    )


def several(numbers: tuple[Number, ...], optional: int = 0) -> Kind[tuple[float, ...]]:
    """A vector, or points."""

    def all_of(given: Sequence[Any]) -> tuple[float, ...]:
        return tuple(map(float, given))

    return Kind(
        lambda _, given: all_of(given[: len(numbers)]),
        lambda value: ("", value),
        all_of,
        numbers=numbers,
        optional=optional,
    )


def fields(numbers: Mapping[str, Number]) -> Kind[Mapping[str, float | str]]:
    """Some values by key, of which cues may give any, and others than numbers too."""

    def numbers_of(value: Mapping[str, float | str]) -> Formatted:
        return "", tuple([float(value[key]) for key in numbers if key in value])

    def plain(given: Any) -> Mapping[str, float | str]:
        return {str(key): value for key, value in dict(given).items() if value is not None}

    return Kind(
        lambda _, given: dict(zip(numbers, given, strict=False)),
        numbers_of,
        plain,
        numbers=tuple(numbers.values()),
    )


def optional_number(what: str, least: float, most: float) -> Kind[float | None]:
    """A number, or none: then the show's own counts."""
    return Kind(
        lambda _, numbers: float(numbers[0]) if numbers else None,
        lambda value: ("", () if value is None else (value,)),
        lambda given: None if given is None else float(given),
        numbers=(Number(what, least, most),),
    )
