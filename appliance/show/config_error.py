"""Errors in a configuration file: file, line, message and cure, several at once."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from appliance.pose.correctable_error import CorrectableError

MOST_PROBLEMS = 30  # in one error: nobody reads more, and a file may have twenty thousand
_LONGEST = 2000  # characters of a message
_LONGEST_WORD = 60


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong. `line` counts from 1; 0 where a file as a whole is meant.

    Words of the file stay on the line of the message: what no printer prints is written as its code.
    """

    file: Path
    line: int
    message: str
    cure: str = ""

    def __post_init__(self) -> None:
        for name in ("message", "cure"):
            object.__setattr__(self, name, _printable(getattr(self, name)))

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}" if self.line else str(self.file)
        return f"{where}: {self.message}" + (f" {self.cure}" if self.cure else "")


AnyProblem = TypeVar("AnyProblem", bound=Problem)


class ConfigError(CorrectableError, ValueError):
    """A file that the box refuses: its problems in the order of their lines, the first MOST_PROBLEMS of them.

    `file`, `line` and `message` are those of the first one. more: problems that were not even looked at.
    """

    def __init__(self, problems: Iterable[Problem], more: int = 0) -> None:
        found = sorted(problems, key=lambda p: (str(p.file), p.line))
        self.problems: tuple[Problem, ...] = tuple(bounded(found, more))
        first = self.problems[0]
        self.file, self.line, self.message = first.file, first.line, first.message
        super().__init__("\n".join(map(str, self.problems)))


def bounded(problems: Sequence[AnyProblem], more: int = 0) -> list[AnyProblem]:
    """The first MOST_PROBLEMS, and how many there are besides."""
    shown, more = list(problems[:MOST_PROBLEMS]), more + max(0, len(problems) - MOST_PROBLEMS)
    if more:
        message = f"{more} more {'things are' if more > 1 else 'thing is'} wrong below this line."
        shown.append(replace(shown[-1], message=message, cure="Mend these first."))
    return shown


class NotAskedForError(ConfigError):
    """Something was started that this box file or show has no use for; trying again does not help."""

    exit_status = os.EX_CONFIG  # 78: systemd does not restart a unit that ends with it


def nearest(word: object, known: Sequence[str]) -> str | None:
    """The known word that was probably meant, whatever its case; None if nothing comes near."""
    folded = {name.casefold(): name for name in known}
    near = difflib.get_close_matches(str(word)[:_LONGEST_WORD].casefold(), folded, n=1, cutoff=0.5)
    return folded[near[0]] if near else None


def shortened(word: object) -> str:
    """A word of a file as far as a message shows it."""
    text = str(word)
    return text if len(text) <= _LONGEST_WORD else f"{text[: _LONGEST_WORD - 3]}..."


def _printable(text: str) -> str:
    if not text.isprintable():
        text = "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def did_you_mean(word: object, known: Sequence[str]) -> str:
    """The cure for a misspelt word: the nearest one, or all of them."""
    if not known:
        return "There is none at all."
    near = nearest(word, known)
    return f"Did you mean '{near}'?" if near else f"Known: {', '.join(known)}."
