"""Joint names as every format can carry them: one line of text each, no two alike."""

from __future__ import annotations

import re
from collections.abc import Sequence

LONGEST = 200  # characters
# Line ends and other control characters, braces (they open a joint in BVH), halves of characters.
_NOT_CARRIED = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff{}]+")


def plain_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, those changed that a file cannot carry: read back they are these again, in the same order.

    An empty name becomes 'joint' and the joint's number; of two that would be alike the second has '_2'.
    """
    found: list[str] = []
    for joint, name in enumerate(names):
        plain = " ".join(_NOT_CARRIED.sub("_", name).split())[:LONGEST].strip() or f"joint{joint}"
        own, number = plain, 2
        while own in found or (own != name and own in names):
            own, number = f"{plain}_{number}", number + 1
        found.append(own)
    return tuple(found)


def changed_names(names: Sequence[str]) -> str:
    """Which names are changed, in words: "'a\\nb' to 'a_b'"; '' where none is."""
    both = zip(names, plain_names(names), strict=True)
    return ", ".join(f"{name!r} to '{plain}'" for name, plain in both if name != plain)
