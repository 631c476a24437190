"""What is wrong with a configuration file: file, line, message and cure, several at once."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong. `line` counts from 1; 0 where a file as a whole is meant."""

    file: Path
    line: int
    message: str
    cure: str = ""

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}" if self.line else str(self.file)
        return f"{where}: {self.message}" + (f" {self.cure}" if self.cure else "")


class ConfigError(ValueError):
    """A file that the box refuses: all its problems, in the order of their lines.

    `file`, `line` and `message` are those of the first one.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems: tuple[Problem, ...] = tuple(sorted(problems, key=lambda p: (str(p.file), p.line)))
        first = self.problems[0]
        self.file, self.line, self.message = first.file, first.line, first.message
        super().__init__("\n".join(map(str, self.problems)))


class NotAskedForError(ConfigError):
    """Something was started that this box file or show has no use for; trying again does not help."""

    exit_status = os.EX_CONFIG  # 78: systemd does not restart a unit that ends with it


def nearest(word: object, known: Sequence[str]) -> str | None:
    """The known word that was probably meant, whatever its case; None if nothing comes near."""
    folded = {name.casefold(): name for name in known}
    near = difflib.get_close_matches(str(word).casefold(), folded, n=1, cutoff=0.5)
    return folded[near[0]] if near else None


def did_you_mean(word: object, known: Sequence[str]) -> str:
    """The cure for a misspelt word: the nearest one, or all of them."""
    if not known:
        return "There is none at all."
    near = nearest(word, known)
    return f"Did you mean '{near}'?" if near else f"Known: {', '.join(known)}."
