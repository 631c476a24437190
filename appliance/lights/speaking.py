"""Whether the lights may send: on a box of a pair only while its stage leads."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

from appliance.box.runtime_folder import runtime_folder
from appliance.outputs.dmx.pace import Universe
from appliance.pair.part import PartReader
from appliance.show.box import BoxConfig

_LOOK_S = 0.004  # while silent: how soon after the stage the lights take over


class Speaking:
    """Tells the wires when this box takes over, and when it cedes. A box without a pair always speaks."""

    def __init__(self, box: BoxConfig, universes: Sequence[Universe]) -> None:
        self._pair, self._universes = box.pair, universes
        self._reader = None if box.pair is None else PartReader(runtime_folder(box))
        self._speaks = box.pair is None

    def may_speak(self, now: float) -> bool:
        """Whether universes may leave; monotonic seconds."""
        if self._reader is None or self._pair is None:
            return True
        part = self._reader.read()
        speaks = part is not None and part.may_speak(now)
        if speaks != self._speaks:
            self._speaks = speaks
            for universe in self._universes:
                if part is not None and speaks:
                    universe.take_over(self._pair.priority * max(0, part.epoch - 1), now)
                else:
                    universe.cede(now)
        return speaks

    def wait(self, deadline: float, period_s: float) -> float | None:
        """While silent: until the next pass on the grid, or until this box leads. None: it speaks."""
        if self._speaks:
            return None
        now = time.monotonic()
        deadline += period_s * max(1, math.ceil((now - deadline) / period_s))
        while (left_s := deadline - time.monotonic()) > 0.0:
            time.sleep(min(_LOOK_S, left_s))
            if self.may_speak(time.monotonic()):
                return time.monotonic()
        return deadline

    def close(self) -> None:
        """Let go of the file."""
        if self._reader is not None:
            self._reader.close()
