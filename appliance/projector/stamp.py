"""A mark in the picture's corner that says how it shows the held joint: `measure --light` reads it."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

CELL = 8  # pixels, wide and high
START, START_BITS = 0b1010, 4
COUNT_BITS, PART_BITS, CHECK_BITS = 4, 10, 4
BITS = START_BITS + COUNT_BITS + 4 * PART_BITS + CHECK_BITS


def stamp(screen: moderngl.Framebuffer, number: int, orientation: Sequence[float] | None) -> None:
    """Draw a row of white and black cells from the bottom left; None: black alone, no dance is shown.

    number: of the picture. orientation: w, x, y, z in the world. The bits, highest first: 1010, the lowest
    four of the number, ten for each part from -1 to 1, and the sum of the eleven nibbles before modulo 16.
    """
    screen.clear(viewport=(0, 0, CELL * BITS, CELL))
    if orientation is None:
        return
    word = number % (1 << COUNT_BITS)
    for part in orientation:
        steps = (1 << PART_BITS) - 1
        word = word << PART_BITS | round((min(max(part, -1.0), 1.0) + 1.0) / 2.0 * steps)
    check = sum(word >> place & 15 for place in range(0, COUNT_BITS + 4 * PART_BITS, 4)) % 16
    cells = (START << COUNT_BITS + 4 * PART_BITS | word) << CHECK_BITS | check
    for place in range(BITS):
        if cells >> BITS - 1 - place & 1:
            screen.clear(1.0, 1.0, 1.0, viewport=(CELL * place, 0, CELL, CELL))
