"""How finely figures are drawn in full pictures: as the chip has time for, measured at the start."""

from __future__ import annotations

import time
from collections.abc import Callable

from appliance.projector.picture.wall import DETAILS, Detail

_SPARE = 0.45  # fraction of the display's period for drawing: cards, masks and other programs need the rest
_TRIES = 2  # the faster one counts


def affordable_detail(
    draw: Callable[[Detail], None], period_s: float, clock: Callable[[], float] = time.perf_counter
) -> Detail:
    """The finest detail for which a drawn picture leaves spare time. draw: draws the dearest look and waits.

    It begins with the coarsest, which every machine draws, and ends with the first that takes too long.
    """
    best = DETAILS[0]
    for detail in DETAILS:
        draw(detail)  # drivers defer work to the first use
        took_s = []
        for _ in range(_TRIES):
            began = clock()
            draw(detail)
            took_s.append(clock() - began)
        if min(took_s) > _SPARE * period_s:
            break
        best = detail
    return best
