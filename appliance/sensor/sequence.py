"""Which packets have come, by sequence number."""

from __future__ import annotations

REMEMBERED = 64


class SequenceWindow:
    """The newest number, and which of the 64 up to it have come (RFC 4303, section 3.4.3)."""

    def __init__(self) -> None:
        self.newest = -1
        self._seen = 0  # bit n: the number n before the newest has come

    def staleness(self, sequence: int) -> str | None:
        """Why this number is not newer than all before: duplicate, reordered or old; None when it is."""
        age = self.newest - sequence
        if age < 0:
            return None
        if age >= REMEMBERED:
            return "old"
        return "duplicate" if self._seen >> age & 1 else "reordered"

    def advance(self, sequence: int) -> int:
        """Take a number as the newest. Returns how many before it are missing."""
        step = sequence - self.newest
        lost = step - 1 if self._seen else 0
        self._seen = (self._seen << step | 1) & (1 << REMEMBERED) - 1 if step < REMEMBERED else 1
        self.newest = sequence
        return lost
