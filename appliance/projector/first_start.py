"""The first start of a box: the test card comes by itself, with the page's address and PIN, once."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from appliance.box.durable import write_whole
from appliance.levers.show_state import ShowState

SHOWS_FOR_S = 600.0
MARK = "used"  # in the box's state folder: this box has been used


class FirstStart:
    """Shows the test card by itself, once, until a sensor is heard or a command comes.

    folder: the state folder. Where nothing can be kept the card would come back at each power-on, even in the
    middle of an evening: there it does not come at all, nor where a picture was aligned or a sensor paired.
    """

    def __init__(self, folder: Path, signs_of_use: tuple[Path | None, ...] = ()) -> None:
        self._mark = folder / MARK
        signs = (self._mark, *(one for one in signs_of_use if one is not None))
        self.is_on = not any(one.exists() for one in signs) and os.access(folder, os.W_OK)
        self._since: float | None = None

    def is_over(self, now: float, sensor_sequence: int, show_state: ShowState, is_shown: bool = True) -> bool:
        """Once: when the card goes. now: seconds on the monotonic clock; sensor_sequence: -1 without one;
        is_shown: False after a person switched the card off."""
        if not self.is_on:
            return False
        self._since = now if self._since is None else self._since
        is_unused = is_shown and sensor_sequence < 0 and not show_state.settings
        if is_unused and now - self._since < SHOWS_FOR_S:
            return False
        self.is_on = False
        with contextlib.suppress(OSError):
            write_whole(self._mark, b"")
        return True
