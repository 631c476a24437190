"""A mark in the picture's corner that says when its dance left the stage: `measure --light` reads it."""

from __future__ import annotations

import moderngl

CELL = 8  # pixels, wide and high
START, START_BITS = 0b1010, 4
TIME_BITS, CHECK_BITS = 28, 4
BITS = START_BITS + TIME_BITS + CHECK_BITS
UNIT_S = 1e-4


def stamp(screen: moderngl.Framebuffer, left_stage: float | None) -> None:
    """Draw a row of white and black cells from the bottom left; None: black alone, no dance is shown.

    left_stage: monotonic seconds. The bits, highest first: 1010, the time in 0.1 ms (its lowest 28 bits), and
    the sum of its seven nibbles modulo 16.
    """
    screen.clear(viewport=(0, 0, CELL * BITS, CELL))
    if left_stage is None:
        return
    time = int(left_stage / UNIT_S) % (1 << TIME_BITS)
    check = sum(time >> place & 15 for place in range(0, TIME_BITS, 4)) % 16
    word = (START << TIME_BITS | time) << CHECK_BITS | check
    for place in range(BITS):
        if word >> BITS - 1 - place & 1:
            screen.clear(1.0, 1.0, 1.0, viewport=(CELL * place, 0, CELL, CELL))
