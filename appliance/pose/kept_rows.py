"""Which rows of a recording are frames, which were lost, and what is said of these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from appliance.pose.counted import counted

_SHOWN_PLACES = 5


@dataclass
class KeptRows:
    """numbers and places: of the frames, among all rows; lost: number and place of the others; why: of the
    first of these.

    unit: what a place is, 'line' of a text or 'frame'. stopped: why no more was read, '' at the end.
    """

    unit: str = "line"
    numbers: list[int] = field(default_factory=list)
    places: list[int] = field(default_factory=list)
    lost: list[tuple[int, int]] = field(default_factory=list)
    why: str = ""
    stopped: str = ""

    @property
    def count(self) -> int:
        """All rows, those that were lost too."""
        return len(self.numbers) + len(self.lost)

    @property
    def lost_in_a_row(self) -> int:
        """How many were lost since the last frame."""
        return self.count - 1 - (self.numbers[-1] if self.numbers else -1)

    def keep(self, place: int) -> None:
        """The next row is a frame."""
        self.numbers.append(self.count)
        self.places.append(place)

    def lose(self, place: int, why: str) -> None:
        """The next row is invalid."""
        self.why = self.why or why.rstrip(".")
        self.lost.append((self.count, place))

    def without(self, unsound: Sequence[int], why: str) -> KeptRows:
        """The same rows where these of the frames turned out to be invalid."""
        off = set(unsound)
        kept = [frame for frame in range(len(self.numbers)) if frame not in off]
        lost = sorted([*self.lost, *((self.numbers[frame], self.places[frame]) for frame in off)])
        return replace(
            self,
            numbers=[self.numbers[frame] for frame in kept],
            places=[self.places[frame] for frame in kept],
            lost=lost,
            why=self.why if self.lost[:1] == lost[:1] else why.rstrip("."),
        )

    def notes(self) -> list[str]:
        """Which rows are not in the recording, in words; some are frames."""
        first, last = self.numbers[0], self.numbers[-1]
        within = [place for number, place in self.lost if first < number < last]
        around = [place for number, place in self.lost if not first < number < last]
        found = []
        for places, one, several in (
            (within, "the figure turns evenly over it", "the figure turns evenly over them"),
            (around, "left out", "left out"),
        ):
            if places:
                done = one if len(places) == 1 else several
                why = f" ({self.why})" if self.lost[0][1] == places[0] else ""
                count = counted(len(places), "row" if self.unit == "line" else self.unit)
                found.append(f"{place_text(places, self.unit)}: {count} lost{why}, {done}")
        return found + ([f"{self.stopped}; what follows is left out"] if self.stopped else [])


def place_text(places: Sequence[int], unit: str) -> str:
    """Rising places in words: 'line 7', 'lines 7 to 9, 12'."""
    spans: list[list[int]] = []
    for place in places:
        if spans and place == spans[-1][1] + 1:
            spans[-1][1] = place
        else:
            spans.append([place, place])
    shown = ", ".join(f"{a}" if a == b else f"{a} to {b}" for a, b in spans[:_SHOWN_PLACES])
    more = f" and {len(spans) - _SHOWN_PLACES} more places" if len(spans) > _SHOWN_PLACES else ""
    return f"{unit if len(places) == 1 else f'{unit}s'} {shown}{more}"
