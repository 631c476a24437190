"""The lights' report for show control, and the walk through the rig that it asks for in the dark."""

from __future__ import annotations

import contextlib
from pathlib import Path

from appliance.box.live_rig import LiveRigWriter
from appliance.box.orders import Order, OrderInbox
from appliance.levers.show_state import ShowState
from appliance.lights.beams import Beam, beams_of
from appliance.lights.patch import Patch, Values
from appliance.lights.walk import Walking, introduction, steps
from appliance.show.config_error import did_you_mean

EVERY_S = 0.2
STEP_S = 3.0
_WALK, _END = "walk", "walk/stop"
_GOES = "The show goes on: a walk through the rig would be seen. Stop it first: /stop."


class LiveRig:
    """Tells those who look how the rig shines. A folder that takes no file costs this alone."""

    def __init__(self, folder: Path) -> None:
        self._writer: LiveRigWriter | None = None
        with contextlib.suppress(OSError):
            self._writer = LiveRigWriter(folder)
        self._due = 0.0

    def publish(self, patch: Patch, values: Values, walk: str, now: float) -> None:
        """values (S,): what the rig shows now; walk: what is walked through."""
        if self._writer is None or now < self._due:
            return
        self._due = now + EVERY_S
        if not self._writer.is_wanted(now):
            return
        self._writer.write([_reported(beam) for beam in beams_of(patch, values)], walk)

    def close(self) -> None:
        """Nothing shines any more."""
        if self._writer is not None:
            self._writer.close()


class OrderedWalk:
    """A walk through the rig by order; only a show that stands dark is walked, and /go, /panic or /blackout
    end it.
    """

    def __init__(self, inbox: OrderInbox | None, patch: Patch, rate_hz: float) -> None:
        self._inbox, self._patch, self._rate_hz = inbox, patch, rate_hz
        self._walking: Walking | None = None

    @property
    def values(self) -> Values | None:
        """(S,) what the last pass of a walk showed; None: there is no walk."""
        return None if self._walking is None else self._walking.values

    @property
    def description(self) -> str:
        """Tells the technician what to look at now."""
        step = None if self._walking is None else self._walking.step
        return "" if step is None else f"{step.fixture}: {step.attribute}, {step.description}"

    def levels(self, show_state: ShowState, now: float) -> dict[int, bytes] | None:
        """512 levels for each universe; None: there is no walk, the dance counts."""
        may_walk = show_state.stands(now) and not (show_state.panic or show_state.blackout)
        while self._inbox is not None and (order := self._inbox.take()) is not None:
            self._inbox.answer(order, *self._obey(order, may_walk))
        if self._walking is None or not may_walk:
            self._walking = None
            return None
        levels = self._walking.levels(now)
        if self._walking.step is None:
            self._walking = None
        return levels

    def end(self) -> None:
        """No walk any more."""
        self._walking = None

    def _obey(self, order: Order, may_walk: bool) -> tuple[bool, str]:
        names = [fixture.name for fixture in self._patch.fixtures]
        if order.name == _END:
            self.end()
            return True, "No walk through the rig."
        if order.name != _WALK:
            return False, f"The lights know no order '{order.name}'."
        if order.text and order.text not in names:
            return False, f"The rig has no fixture '{order.text}'. {did_you_mean(order.text, names)}"
        if not may_walk:
            return False, _GOES
        to_see = list(steps(self._patch, (order.text,) if order.text else ()))
        self._walking = Walking(self._patch, to_see, STEP_S, self._rate_hz)
        first = introduction(self._patch, to_see[0].fixture) if to_see else "nothing"
        return True, f"{len(to_see)} steps, first {first}."


def _reported(beam: Beam) -> list[object]:
    """As box/live_rig.py says."""
    place, way, colour = (
        [round(float(part), 3) for part in one] for one in (beam.place, beam.direction, beam.colour)
    )
    return [beam.fixture.name, place, way, colour, round(beam.level, 3), round(beam.degrees, 1)]
