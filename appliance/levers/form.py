"""Forms: the arguments that an address takes, within which bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

FAR = 1e6
MOST_FADE_S = 60.0
_MOST_SAID = 4  # optional numbers in an error


class Number(NamedTuple):
    """One number that a command takes."""

    what: str
    least: float
    most: float
    is_whole: bool = False

    def admits(self, given: float) -> bool:
        """Whether it is finite and within the bounds."""
        return self.least <= given <= self.most and not (self.is_whole and given % 1)

    def __str__(self) -> str:
        if self.is_whole and self.most - self.least == 1:
            return f"{self.least:g} or {self.most:g}"
        bounds = f"{self.least:g} to {self.most:g}" if self.most < FAR else f"from {self.least:g}"
        return f"{self.what} ({bounds})" if abs(self.least) < FAR else self.what


FADE = Number("fade in seconds", 0, MOST_FADE_S)


@dataclass(frozen=True, slots=True)
class Form:
    """The arguments of an address: a text, then numbers.

    text: what the first argument names; empty: the address takes no text. may_be_nameless: the text may be
    left out. also: what a second text names. optional: how many of the last numbers may be left out.
    """

    text: str = ""
    numbers: tuple[Number, ...] = ()
    optional: int = 0
    may_be_nameless: bool = False
    also: str = ""

    def syntax(self) -> str:
        """The arguments, for people."""
        text = f"[{self.text}]" if self.text and self.may_be_nameless else self.text
        fewest = len(self.numbers) - self.optional
        parts = [*filter(None, (text, self.also)), *map(str, self.numbers[:fewest])]
        parts += [f"[{number}]" for number in self.numbers[fewest:][:_MOST_SAID]]
        parts += ["..."] if self.optional > _MOST_SAID else []
        return ", ".join(parts) or "nothing"

    def admits(self, numbers: Sequence[int | float]) -> bool:
        """Whether these are as many as it takes, finite, and within the bounds."""
        if not len(self.numbers) - self.optional <= len(numbers) <= len(self.numbers):
            return False
        return all(wanted.admits(given) for wanted, given in zip(self.numbers, numbers, strict=False))
