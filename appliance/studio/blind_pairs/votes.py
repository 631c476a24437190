"""Votes of blind pairs: the preference with its 95 % interval, and whether a side was preferred."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from appliance.studio.studio_error import StudioError

Z = 1.959964  # 95 % of a normal distribution lie within
SIDES = ("left", "right")


@dataclass(frozen=True)
class Preference:
    """How many of the votes one of two got."""

    chosen: int
    votes: int

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the share, 0 to 1 (Wilson 1927, 'Probable inference')."""
        n, share = self.votes, self.chosen / self.votes
        middle = (share + Z * Z / (2 * n)) / (1 + Z * Z / n)
        half = Z / (1 + Z * Z / n) * math.sqrt(share * (1 - share) / n + Z * Z / (4 * n * n))
        return max(0.0, middle - half), min(1.0, middle + half)

    @property
    def is_shown(self) -> bool:
        """Whether the interval excludes 50 %, with which a coin would be as good."""
        low, high = self.interval
        return low > 0.5 or high < 0.5

    def text(self) -> str:
        """'14 of 20 votes, 70 % (95 % interval 48 to 85 %)'."""
        low, high = self.interval
        share = f"{self.chosen} of {self.votes} votes, {self.chosen / self.votes:.0%}"
        return f"{share} (95 % interval {100 * low:.0f} to {100 * high:.0f} %)"


@dataclass(frozen=True)
class Result:
    """The first of two dances against the other, and the left side against the right, over all voters."""

    names: tuple[str, str]
    voters: int
    first: Preference
    left: Preference

    def sentences(self) -> list[str]:
        """For people."""
        one, other = self.names
        better = one if self.first.chosen * 2 > self.first.votes else other
        verdict = (
            f"{better} is preferred."
            if self.first.is_shown
            else "No preference is shown: a coin may vote like this."
        )
        people = "1 voter" if self.voters == 1 else f"{self.voters} voters"
        said = [f"{one} over {other}: {self.first.text()}, {people}. {verdict}"]
        if self.left.is_shown:
            said.append(f"A side was preferred: left has {self.left.text()}. Do not trust the preference.")
        return said


def packed_key(first_is_left: Sequence[bool]) -> str:
    """Which side of each pair shows the first dance; nobody reads it by accident."""
    return base64.b64encode(bytes(first_is_left)).decode("ascii")


def result_of(files: Sequence[Path]) -> Result:
    """Count the votes of all files. Raises StudioError for other files, mixed studies, one voter twice."""
    names: tuple[str, str] | None = None
    study, voters = "", set()
    first = left = votes = 0
    for file in files:
        facts = _read(file)
        if study not in ("", facts["study"]):
            raise StudioError(f"{file} has votes of another page than {files[0]}. Count each page by itself.")
        if facts["voter"] in voters:
            raise StudioError(f"{file} is of a voter that was counted already. Give each file once.")
        voters.add(facts["voter"])
        study, names = facts["study"], (facts["a"], facts["b"])
        key = base64.b64decode(facts["key"])
        for vote in facts["votes"]:
            is_left = vote["chosen"] == SIDES[0]
            first += is_left == bool(key[vote["pair"]])
            left += is_left
            votes += 1
    if names is None or not votes:
        raise StudioError("There is no vote in it. Open the page, choose, and download the votes at its end.")
    return Result(names, len(voters), Preference(first, votes), Preference(left, votes))


def _read(file: Path) -> dict[str, Any]:
    try:
        facts: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        pairs = len(base64.b64decode(facts["key"], validate=True))
        chosen = [(vote["pair"], vote["chosen"]) for vote in facts["votes"]]
        sound = all(isinstance(pair, int) and 0 <= pair < pairs and side in SIDES for pair, side in chosen)
        if not sound or len({pair for pair, _ in chosen}) < len(chosen):
            raise ValueError
        if not all(isinstance(facts[name], str) for name in ("study", "voter", "a", "b")):
            raise ValueError
    except (ValueError, LookupError, TypeError, AttributeError):
        raise StudioError(
            f"{file} has no votes of a page that bunraku compare-blind made. Download them at its end."
        ) from None
    return facts
