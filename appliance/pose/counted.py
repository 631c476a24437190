"""A number with what it counts: '1 thread', '2 threads'."""

from __future__ import annotations


def counted(number: int, thing: str) -> str:
    """The number, with commas, and the word in its singular or plural; thing: a word that takes an s."""
    return f"{number:,} {thing}" + ("" if number == 1 else "s")
